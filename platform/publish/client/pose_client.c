/* SPDX-License-Identifier: Apache-2.0 */
/*
 * An example client: prints every pose and map event as a line, until it is interrupted.
 *
 *     cc -std=c11 -D_POSIX_C_SOURCE=200809L -I INCLUDE pose_client.c -o pose_client
 *     ./pose_client [FILE [COUNT]]      FILE: /run/haustra/poses; COUNT: stop after so many poses
 *
 * Exit code 0; 1 when the file cannot be used.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "haustra_pose_ring.h"

static void print_pose(const struct haustra_pose* pose) {
  printf("pose %" PRIu64 " frame %" PRIu64 " %s %s", pose->sequence, pose->frame_index, haustra_state_name(pose->state),
         haustra_reason_name(pose->reason));
  if (pose->flags & HAUSTRA_POSE_VALID) {
    printf(" map %" PRIu32 ".%" PRIu64 " at %.4f %.4f %.4f%s", pose->map_id, pose->map_epoch, pose->position_mu[0],
           pose->position_mu[1], pose->position_mu[2], pose->flags & HAUSTRA_POSE_PREDICTED ? " predicted" : "");
  }
  printf(" latency %.1f ms\n", (double)(pose->published_ns - pose->captured_ns) * 1e-6);
}

static void pause_ns(int64_t nanoseconds) {
  struct timespec time = {(time_t)(nanoseconds / 1000000000), (long)(nanoseconds % 1000000000)};
  nanosleep(&time, NULL);
}

int main(int argc, char** argv) {
  const char* path = argc > 1 ? argv[1] : "/run/haustra/poses";
  uint64_t wanted = argc > 2 ? strtoull(argv[2], NULL, 10) : 0;
  uint64_t num_poses = 0;
  struct haustra_ring ring;
  int result = haustra_ring_open(&ring, path);
  if (result == HAUSTRA_NO_FILE) fprintf(stderr, "%s: %s\n", path, strerror(errno));
  if (result == HAUSTRA_NOT_A_RING) fprintf(stderr, "%s: not a file of haustrad\n", path);
  if (result == HAUSTRA_OTHER_VERSION) fprintf(stderr, "%s: of another version than this client\n", path);
  if (result != HAUSTRA_OK) return 1;

  uint64_t pose_cursor = 0, event_cursor = 0, num_missed = 0;
  while (wanted == 0 || num_poses < wanted) {
    struct haustra_event event;
    struct haustra_pose pose;
    while (haustra_ring_next_event(&ring, &event_cursor, &event, &num_missed) == HAUSTRA_OK) {
      printf("event %s map %" PRId32 "\n", haustra_event_name(event.kind), (int32_t)event.map_id);
    }
    if (haustra_ring_next_pose(&ring, &pose_cursor, &pose, &num_missed) == HAUSTRA_OK) {
      if (num_missed > 0) printf("missed %" PRIu64 "\n", num_missed);
      print_pose(&pose);
      ++num_poses;
      continue;
    }
    fflush(stdout);
    if (haustra_ring_service(&ring) == HAUSTRA_SERVICE_CLOSED || haustra_ring_is_replaced(&ring, path)) {
      haustra_ring_close(&ring);
      printf("closed\n");
      /* The daemon was stopped or begins anew. */
      while (haustra_ring_open(&ring, path) != HAUSTRA_OK) {
        if (wanted != 0) return 0;
        pause_ns(200000000);
      }
      pose_cursor = event_cursor = 0;
    }
    pause_ns(haustra_ring_pause_ns(&ring, haustra_now_ns()));
  }
  haustra_ring_close(&ring);
  return 0;
}
