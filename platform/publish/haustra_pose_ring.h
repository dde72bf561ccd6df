/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Where the scope is, for other processes: C11 (or C++) reader of the shared-memory file that haustrad writes. This
 * file is all that a client needs; it includes the C library and POSIX only, and needs gcc or clang (atomic builtins).
 *
 *     struct haustra_ring ring;
 *     if (haustra_ring_open(&ring, "/run/haustra/poses") != HAUSTRA_OK) ...
 *     struct haustra_pose pose;
 *     if (haustra_ring_latest_pose(&ring, &pose) == HAUSTRA_OK && haustra_pose_is_current(&pose, 200000000)) ...
 *     haustra_ring_close(&ring);
 *
 * What holds:
 *   - The writer never waits for a reader and never looks at one: any number may come, stop, or die.
 *   - A reader maps the file read-only, never blocks, and gets whole records or none. It looks from time to time: poses
 *     come as evenly as frames do, so haustra_ring_pause_ns() knows when the next look is worth while. (Waking readers
 *     would be a system call of the tracking thread, the longer the more of them there are.)
 *   - The last HAUSTRA_POSE_SLOTS poses and HAUSTRA_EVENT_SLOTS map events are kept. A reader that falls further behind
 *     is told how many it missed.
 *   - When the daemon stops or starts anew, the old file is closed (haustra_ring_service: HAUSTRA_SERVICE_CLOSED) and a
 *     new one takes its name: haustra_ring_is_replaced() says when to open again. After a crash the old file is closed
 *     by the next start; until then haustra_ring_is_alive() tells.
 *   - The sequence numbers of each file begin anew, so after opening again a reader's cursors begin at 0: older ones
 *     would pass over what the new daemon publishes.
 *   - At the end of a procedure the daemon wipes poses, events and snapshots here too. Sequence numbers go on.
 *
 * Lengths are map units (suffix _mu). A monocular map has a scale of its own: map units are not millimetres, and differ
 * from map to map. Axes of the camera: x right, y down, z forward, as in a picture.
 *
 * Errors of the functions are negative (enum haustra_result). No function allocates, except that open maps the file.
 * A struct haustra_ring may be used by several threads at once, except for opening and closing.
 */
#ifndef HAUSTRA_POSE_RING_H_
#define HAUSTRA_POSE_RING_H_

#include <errno.h>
#include <fcntl.h>
#include <stdint.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#ifdef __cplusplus
extern "C" {
#endif

#define HAUSTRA_RING_MAGIC UINT64_C(0x3161727473756168) /* "haustra1" */
/* Changes whenever the layout does. A client refuses another version than the one it was built with. */
#define HAUSTRA_RING_VERSION 2u

#define HAUSTRA_POSE_SLOTS 256u /* 10 s at 25 Hz */
#define HAUSTRA_EVENT_SLOTS 256u
#define HAUSTRA_SNAPSHOT_SLOTS 2u
#define HAUSTRA_SNAPSHOT_POINTS 16384u /* of a larger map, an even selection */
#define HAUSTRA_SNAPSHOT_KEYFRAMES 2048u
#define HAUSTRA_MAX_MARKS 32u
#define HAUSTRA_MARK_LABEL_BYTES 32u
#define HAUSTRA_NO_MAP UINT32_C(0xffffffff)

enum haustra_result {
  HAUSTRA_OK = 0,
  HAUSTRA_NOT_YET = -1,       /* nothing with that sequence has been published */
  HAUSTRA_OVERRUN = -2,       /* it was overwritten (or wiped) before it could be read */
  HAUSTRA_NO_FILE = -3,       /* there is no such file, or it may not be read: errno says why */
  HAUSTRA_NOT_A_RING = -4,    /* the file is something else, or cut short */
  HAUSTRA_OTHER_VERSION = -5, /* a layout that this header does not know */
  HAUSTRA_BUSY = -6           /* it was being written at every attempt: try again */
};

/* What the service is doing; see haustra_ring_service(). */
enum haustra_service {
  HAUSTRA_SERVICE_STARTING = 0,
  HAUSTRA_SERVICE_IDLE = 1,        /* no procedure: nothing is looked at */
  HAUSTRA_SERVICE_RUNNING = 2,     /* a procedure, and frames come */
  HAUSTRA_SERVICE_NO_SIGNAL = 3,   /* a procedure, but the camera gives no frames */
  HAUSTRA_SERVICE_SOURCE_OVER = 4, /* a procedure, but its recording is over */
  HAUSTRA_SERVICE_CLOSED = 5       /* this file is written no more */
};

/* Names are those of the columns state and reason of frames.csv. New numbers are only ever added. */
enum haustra_state { HAUSTRA_STATE_INITIALISING = 0, HAUSTRA_STATE_TRACKING = 1, HAUSTRA_STATE_LOST = 2 };

/* How the pose came about, or why there is none; meanings in tools/run/README.md. */
enum haustra_reason {
  HAUSTRA_REASON_TRACKED = 0,
  HAUSTRA_REASON_RECOVERED = 1,
  HAUSTRA_REASON_RELOCALISED = 2,
  HAUSTRA_REASON_DAMAGED_FRAME = 3,
  HAUSTRA_REASON_FEW_FEATURES = 4,
  HAUSTRA_REASON_FEW_MATCHES = 5,
  HAUSTRA_REASON_FEW_INLIERS = 6,
  HAUSTRA_REASON_UNCLEAR_VIEW = 7,
  HAUSTRA_REASON_INCONSISTENT_MOTION = 8,
  HAUSTRA_REASON_FIRST_VIEW = 9,
  HAUSTRA_REASON_NO_REFERENCE = HAUSTRA_REASON_FIRST_VIEW, /* its earlier name */
  HAUSTRA_REASON_LOW_PARALLAX = 10,
  HAUSTRA_REASON_NO_EPIPOLAR_GEOMETRY = 11,
  HAUSTRA_REASON_LOW_SPREAD = 12,
  HAUSTRA_REASON_MAP_PROPOSED = 13,
  HAUSTRA_REASON_AWAITING_MAP = 14,
  HAUSTRA_REASON_PREDICTED = 15,
  HAUSTRA_REASON_NO_TIME = 16,
  HAUSTRA_REASON_UNCERTAIN_MOTION = 17,
  HAUSTRA_REASON_DENIED_BY_FLOW = 18
};

enum haustra_pose_flag {
  HAUSTRA_POSE_VALID = 1u << 0,     /* position and orientation mean something */
  HAUSTRA_POSE_PREDICTED = 1u << 1, /* extrapolated from earlier frames, not measured in this one */
  HAUSTRA_POSE_KEYFRAME = 1u << 2,
  HAUSTRA_POSE_SCALE_KNOWN = 1u << 3 /* map units are metres: never set by a monocular camera */
};

/* Names are those of the column state of marks.csv. */
enum haustra_mark_state {
  HAUSTRA_MARK_OUT_OF_VIEW = 0,
  HAUSTRA_MARK_IN_FRONT = 1, /* it can be seen: draw it */
  HAUSTRA_MARK_HIDDEN = 2,   /* the wall is between, or it is seen from behind: do not draw it */
  HAUSTRA_MARK_UNSURE = 3    /* in the picture, but the map does not tell whether it can be seen */
};

/* A place that was marked, as the frame of the pose sees it. */
struct haustra_mark_sighting {
  uint32_t id;              /* haustra_mark.id */
  uint32_t state;           /* enum haustra_mark_state */
  float u_px, v_px;         /* in the picture, centre of the first pixel at 0; zero when out of view */
  float distance_in_depths; /* from the camera, over the median distance of what the frame shows */
  uint32_t reserved;
};

/* Times count nanoseconds of CLOCK_MONOTONIC unless the name says otherwise. */
struct haustra_pose {
  uint64_t sequence;    /* counts from 1 over the life of the file; a gap is a pose that was missed */
  int64_t captured_ns;  /* when the frame was taken (recordings: when it was due) */
  int64_t published_ns; /* when this answer was published */
  int64_t source_ns;    /* time stamp that the source gave the frame, on the source's own clock */
  uint64_t frame_index; /* of the source; gaps are frames that were dropped or lost */
  uint64_t procedure;   /* number of the procedure; no other one has it, nor after a restart of the service */
  /* Changes with every move of a map (loop closed, maps merged). Poses compare only when map_id and map_epoch agree. */
  uint64_t map_epoch;
  uint32_t map_id; /* HAUSTRA_NO_MAP without one */
  uint32_t state;  /* enum haustra_state */
  uint32_t reason; /* enum haustra_reason */
  uint32_t flags;  /* enum haustra_pose_flag */
  /* map_from_cam: where the camera's centre lies in the map, and the rotation (unit quaternion x y z w) that takes
     directions of the camera into the map. Zero without HAUSTRA_POSE_VALID. */
  double position_mu[3];
  double orientation_xyzw[4];
  uint32_t num_features;
  uint32_t num_inliers; /* points of the map that agree with the pose */
  uint32_t num_marks;   /* in marks[]: all of the map; none without HAUSTRA_POSE_VALID */
  uint32_t reserved;
  struct haustra_mark_sighting marks[HAUSTRA_MAX_MARKS]; /* not meaningful beyond num_marks */
};

enum haustra_event_kind {
  HAUSTRA_EVENT_MAP_CREATED = 0,
  HAUSTRA_EVENT_MAP_REFUSED = 1,
  HAUSTRA_EVENT_MAP_DROPPED = 2,
  HAUSTRA_EVENT_MAP_STORED = 3, /* tracking was lost; the map waits to be found again */
  HAUSTRA_EVENT_MERGED = 4,     /* other_map_id became part of map_id */
  HAUSTRA_EVENT_LOOP_CLOSED = 5,
  HAUSTRA_EVENT_MERGE_REJECTED = 6,
  HAUSTRA_EVENT_FRAME_FOUND = 7, /* lost tracking found itself in map_id */
  HAUSTRA_EVENT_FRAME_NOT_FOUND = 8,
  HAUSTRA_EVENT_MAP_EVICTED = 9, /* a stored map that had to make room */
  HAUSTRA_EVENT_PROCEDURE_BEGUN = 1000,
  HAUSTRA_EVENT_PROCEDURE_ENDED = 1001
};

struct haustra_event {
  uint64_t sequence; /* counts from 1 over the life of the file */
  int64_t published_ns;
  uint64_t frame_index;
  uint64_t procedure;
  uint32_t kind; /* enum haustra_event_kind */
  uint32_t map_id;
  uint32_t other_map_id;
  uint32_t num_keyframes;
  uint32_t num_points;
  uint32_t num_inliers; /* of a merge, a loop or a frame found: matches that agree with it */
};

struct haustra_point {
  float position_mu[3];
  uint32_t id;
};

/* A place that somebody has marked, in any map. */
struct haustra_mark {
  uint32_t id;          /* never given twice */
  uint32_t map_id;      /* that it lies in now */
  uint32_t session;     /* run of the atlas that it was set in */
  uint32_t frame_index; /* of that run */
  float position_mu[3];
  uint32_t reserved;
  char label[HAUSTRA_MARK_LABEL_BYTES]; /* ends with a zero */
};

/* The active map at one moment. */
struct haustra_snapshot {
  uint64_t sequence; /* counts from 1 over the life of the file */
  int64_t published_ns;
  uint64_t procedure;
  uint64_t map_epoch; /* as that of the poses */
  uint32_t map_id;
  uint32_t num_points;        /* in points[] */
  uint32_t num_map_points;    /* of the map */
  uint32_t num_keyframes;     /* in keyframes[], the oldest first */
  uint32_t num_map_keyframes; /* of the map */
  uint32_t num_maps;          /* that hold keyframes, the active one included */
  uint32_t num_marks;         /* in marks[], of all maps */
  uint32_t reserved;
  struct haustra_mark marks[HAUSTRA_MAX_MARKS];
  struct haustra_point keyframes[HAUSTRA_SNAPSHOT_KEYFRAMES]; /* camera centres */
  struct haustra_point points[HAUSTRA_SNAPSHOT_POINTS];
};

/* ---- Layout of the file. A client has no need to look below this line for anything but the functions. ---- */

/* A slot holds one record behind a lock word: 2 * sequence when the record is whole, odd while it is written, 0 when it
   was wiped. Everything in a slot is read and written in atomic 64-bit words. */
struct haustra_pose_slot {
  uint64_t lock;
  struct haustra_pose record;
};
struct haustra_event_slot {
  uint64_t lock;
  struct haustra_event record;
};
struct haustra_snapshot_slot {
  uint64_t lock;
  struct haustra_snapshot record;
};

struct haustra_ring_header {
  uint64_t magic;
  uint32_t version;
  uint32_t header_bytes;
  uint64_t file_bytes;
  uint32_t pose_slot_bytes, num_pose_slots;
  uint32_t event_slot_bytes, num_event_slots;
  uint32_t snapshot_slot_bytes, num_snapshot_slots;
  uint64_t writer_pid;
  /* From here on atomic words that change. */
  uint64_t service;      /* enum haustra_service */
  uint64_t procedure;    /* number of the newest procedure; 0: none yet */
  int64_t alive_ns;      /* when the service last said that it is there; it does so every 100 ms */
  uint64_t newest_event; /* sequence; 0: none yet */
  uint64_t newest_snapshot;
  uint64_t reserved[3];
  uint64_t newest_pose __attribute__((aligned(64))); /* written by the tracking thread alone */
  uint64_t reserved_too[7];
};

struct haustra_ring_file {
  struct haustra_ring_header header;
  struct haustra_pose_slot poses[HAUSTRA_POSE_SLOTS];
  struct haustra_event_slot events[HAUSTRA_EVENT_SLOTS];
  struct haustra_snapshot_slot snapshots[HAUSTRA_SNAPSHOT_SLOTS];
};

#ifdef __cplusplus
#define HAUSTRA_STATIC_ASSERT static_assert
#else
#define HAUSTRA_STATIC_ASSERT _Static_assert
#endif
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_mark_sighting) == 24, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_mark) == 64, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_pose) == 912, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_event) == 56, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_snapshot) % 8 == 0, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_ring_header) == 192, "layout");

struct haustra_ring {
  const struct haustra_ring_file* file;
  uint64_t device, inode; /* of the file that is open */
};

/* ---- Functions ---- */

static inline int64_t haustra_now_ns(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* HAUSTRA_NO_FILE, HAUSTRA_NOT_A_RING, HAUSTRA_OTHER_VERSION; `ring` is empty then. */
static inline int haustra_ring_open(struct haustra_ring* ring, const char* path) {
  struct stat info;
  void* memory;
  struct haustra_ring_header header;
  int file;
  ssize_t count;
  memset(ring, 0, sizeof *ring);
  file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return HAUSTRA_NO_FILE;
  count = read(file, &header, sizeof header);
  if (fstat(file, &info) != 0 || !S_ISREG(info.st_mode) || count < 16 || header.magic != HAUSTRA_RING_MAGIC) {
    close(file);
    return HAUSTRA_NOT_A_RING;
  }
  if (header.version != HAUSTRA_RING_VERSION) {
    close(file);
    return HAUSTRA_OTHER_VERSION;
  }
  if (count < (ssize_t)sizeof header || header.header_bytes != sizeof header ||
      header.file_bytes != sizeof(struct haustra_ring_file) || (uint64_t)info.st_size < header.file_bytes ||
      header.pose_slot_bytes != sizeof(struct haustra_pose_slot) || header.num_pose_slots != HAUSTRA_POSE_SLOTS ||
      header.event_slot_bytes != sizeof(struct haustra_event_slot) || header.num_event_slots != HAUSTRA_EVENT_SLOTS ||
      header.snapshot_slot_bytes != sizeof(struct haustra_snapshot_slot) ||
      header.num_snapshot_slots != HAUSTRA_SNAPSHOT_SLOTS) {
    close(file);
    return HAUSTRA_NOT_A_RING;
  }
  memory = mmap(NULL, sizeof(struct haustra_ring_file), PROT_READ, MAP_SHARED, file, 0);
  close(file);
  if (memory == MAP_FAILED) return HAUSTRA_NO_FILE;
  ring->file = (const struct haustra_ring_file*)memory;
  ring->device = (uint64_t)info.st_dev;
  ring->inode = (uint64_t)info.st_ino;
  return HAUSTRA_OK;
}

static inline void haustra_ring_close(struct haustra_ring* ring) {
  if (ring->file != NULL) munmap((void*)(uintptr_t)ring->file, sizeof(struct haustra_ring_file));
  memset(ring, 0, sizeof *ring);
}

/* 1 when another file has the name now (a new start of the daemon): close and open. 0 when not, or when there is no
   file at the moment. */
static inline int haustra_ring_is_replaced(const struct haustra_ring* ring, const char* path) {
  struct stat info;
  if (stat(path, &info) != 0) return 0;
  return (uint64_t)info.st_dev != ring->device || (uint64_t)info.st_ino != ring->inode;
}

static inline uint64_t haustra_load_(const uint64_t* word) { return __atomic_load_n(word, __ATOMIC_ACQUIRE); }

/* enum haustra_service. */
static inline uint32_t haustra_ring_service(const struct haustra_ring* ring) {
  return (uint32_t)haustra_load_(&ring->file->header.service);
}

/* 1 while the writer is there: not closed, and heard of within `max_age_ns` (a second is a good limit). */
static inline int haustra_ring_is_alive(const struct haustra_ring* ring, int64_t max_age_ns) {
  int64_t alive_ns = __atomic_load_n(&ring->file->header.alive_ns, __ATOMIC_ACQUIRE);
  return haustra_ring_service(ring) != HAUSTRA_SERVICE_CLOSED && haustra_now_ns() - alive_ns <= max_age_ns;
}

/* Sequence of the newest record, 0 when there is none yet. */
static inline uint64_t haustra_ring_newest_pose(const struct haustra_ring* ring) {
  return haustra_load_(&ring->file->header.newest_pose);
}
static inline uint64_t haustra_ring_newest_event(const struct haustra_ring* ring) {
  return haustra_load_(&ring->file->header.newest_event);
}
static inline uint64_t haustra_ring_newest_snapshot(const struct haustra_ring* ring) {
  return haustra_load_(&ring->file->header.newest_snapshot);
}

/* Copies the record behind `lock` when it is that of `sequence` from the first word to the last. Every word is loaded
   with acquire: if one of them is newer than the lock that was seen first, the second look at the lock shows it (Boehm,
   Can seqlocks get along with programming language memory models?, 2012). No fence, so that race detectors can follow.
 */
static inline int haustra_read_slot_(const uint64_t* lock, uint64_t sequence, void* record, size_t num_bytes) {
  const uint64_t* from = lock + 1;
  char* to = (char*)record;
  size_t i;
  if (haustra_load_(lock) != 2 * sequence) return HAUSTRA_OVERRUN;
  for (i = 0; i < num_bytes / 8; ++i) {
    const uint64_t word = haustra_load_(from + i);
    memcpy(to + 8 * i, &word, 8);
  }
  return __atomic_load_n(lock, __ATOMIC_RELAXED) == 2 * sequence ? HAUSTRA_OK : HAUSTRA_OVERRUN;
}

/* The record with that sequence: HAUSTRA_NOT_YET, HAUSTRA_OVERRUN. `pose` is not meaningful then. */
static inline int haustra_ring_read_pose(const struct haustra_ring* ring, uint64_t sequence,
                                         struct haustra_pose* pose) {
  if (sequence == 0 || sequence > haustra_ring_newest_pose(ring)) return HAUSTRA_NOT_YET;
  return haustra_read_slot_(&ring->file->poses[sequence % HAUSTRA_POSE_SLOTS].lock, sequence, pose, sizeof *pose);
}
static inline int haustra_ring_read_event(const struct haustra_ring* ring, uint64_t sequence,
                                          struct haustra_event* event) {
  if (sequence == 0 || sequence > haustra_ring_newest_event(ring)) return HAUSTRA_NOT_YET;
  return haustra_read_slot_(&ring->file->events[sequence % HAUSTRA_EVENT_SLOTS].lock, sequence, event, sizeof *event);
}

/* The newest pose, whatever its state: look at flags and age. HAUSTRA_NOT_YET before the first frame and after a wipe.
 */
static inline int haustra_ring_latest_pose(const struct haustra_ring* ring, struct haustra_pose* pose) {
  int attempt;
  uint64_t newest = 0;
  for (attempt = 0; attempt < 8; ++attempt) {
    newest = haustra_ring_newest_pose(ring);
    if (newest == 0) return HAUSTRA_NOT_YET;
    if (haustra_ring_read_pose(ring, newest, pose) == HAUSTRA_OK) return HAUSTRA_OK;
  }
  /* The reader slept for a whole round of the ring, eight times; or there is nothing to be had. */
  return haustra_load_(&ring->file->poses[newest % HAUSTRA_POSE_SLOTS].lock) == 0 ? HAUSTRA_NOT_YET : HAUSTRA_BUSY;
}

/* Oldest sequence that is safe to ask for: the slot before it may be under way. */
static inline uint64_t haustra_oldest_(uint64_t newest, uint64_t num_slots) {
  return newest + 2 > num_slots ? newest + 2 - num_slots : 1;
}

/* The record after `*cursor` (the sequence that was read last, 0 at first), in order. `*num_missed` counts those
   between that can no longer be had. HAUSTRA_NOT_YET when all were read. */
static inline int haustra_ring_next_pose(const struct haustra_ring* ring, uint64_t* cursor, struct haustra_pose* pose,
                                         uint64_t* num_missed) {
  uint64_t wanted = *cursor + 1;
  for (;;) {
    const uint64_t newest = haustra_ring_newest_pose(ring);
    if (wanted > newest) {
      *num_missed = wanted - 1 - *cursor;
      *cursor = wanted - 1;
      return HAUSTRA_NOT_YET;
    }
    if (haustra_ring_read_pose(ring, wanted, pose) == HAUSTRA_OK) {
      *num_missed = wanted - *cursor - 1;
      *cursor = wanted;
      return HAUSTRA_OK;
    }
    ++wanted;
    if (wanted < haustra_oldest_(newest, HAUSTRA_POSE_SLOTS)) wanted = haustra_oldest_(newest, HAUSTRA_POSE_SLOTS);
  }
}
static inline int haustra_ring_next_event(const struct haustra_ring* ring, uint64_t* cursor,
                                          struct haustra_event* event, uint64_t* num_missed) {
  uint64_t wanted = *cursor + 1;
  for (;;) {
    const uint64_t newest = haustra_ring_newest_event(ring);
    if (wanted > newest) {
      *num_missed = wanted - 1 - *cursor;
      *cursor = wanted - 1;
      return HAUSTRA_NOT_YET;
    }
    if (haustra_ring_read_event(ring, wanted, event) == HAUSTRA_OK) {
      *num_missed = wanted - *cursor - 1;
      *cursor = wanted;
      return HAUSTRA_OK;
    }
    ++wanted;
    if (wanted < haustra_oldest_(newest, HAUSTRA_EVENT_SLOTS)) wanted = haustra_oldest_(newest, HAUSTRA_EVENT_SLOTS);
  }
}

/* How long to sleep before the next look, in nanoseconds; `now_ns` is haustra_now_ns(). While poses come: until shortly
   before the next one is due, and 2 ms from then on, which is about five looks at a frame. While none come: 20 ms. */
static inline int64_t haustra_ring_pause_ns(const struct haustra_ring* ring, int64_t now_ns) {
  const int64_t ms = 1000000;
  const uint64_t newest = haustra_ring_newest_pose(ring);
  struct haustra_pose last, before;
  int64_t num_frames, period_ns, latency_ns, pause_ns;
  if (haustra_ring_read_pose(ring, newest, &last) != HAUSTRA_OK) return 20 * ms;
  if (haustra_ring_read_pose(ring, newest - 1, &before) != HAUSTRA_OK) return 2 * ms;
  num_frames = (int64_t)(last.frame_index - before.frame_index);
  period_ns = num_frames > 0 ? (last.captured_ns - before.captured_ns) / num_frames : 0;
  if (period_ns <= 0 || now_ns - last.published_ns > 2 * period_ns + 20 * ms) return 20 * ms;
  /* The shorter of two latencies: after a slow frame the next one is not late. */
  latency_ns = last.published_ns - last.captured_ns;
  if (latency_ns > before.published_ns - before.captured_ns) latency_ns = before.published_ns - before.captured_ns;
  pause_ns = last.captured_ns + period_ns + latency_ns - period_ns / 8 - now_ns;
  if (pause_ns > 100 * ms) return 100 * ms;
  return pause_ns > 2 * ms ? pause_ns : 2 * ms;
}

/* The newest map snapshot into a buffer of the caller's (about 300 kB: not on a small stack). HAUSTRA_NOT_YET,
   HAUSTRA_BUSY. */
static inline int haustra_ring_latest_snapshot(const struct haustra_ring* ring, struct haustra_snapshot* snapshot) {
  int attempt;
  uint64_t newest = 0;
  for (attempt = 0; attempt < 8; ++attempt) {
    newest = haustra_ring_newest_snapshot(ring);
    if (newest == 0) return HAUSTRA_NOT_YET;
    if (haustra_read_slot_(&ring->file->snapshots[newest % HAUSTRA_SNAPSHOT_SLOTS].lock, newest, snapshot,
                           sizeof *snapshot) == HAUSTRA_OK) {
      return HAUSTRA_OK;
    }
  }
  return haustra_load_(&ring->file->snapshots[newest % HAUSTRA_SNAPSHOT_SLOTS].lock) == 0 ? HAUSTRA_NOT_YET
                                                                                          : HAUSTRA_BUSY;
}

/* 1 when the pose was measured (not predicted) and its frame is not older than `max_age_ns`. */
static inline int haustra_pose_is_current(const struct haustra_pose* pose, int64_t max_age_ns) {
  return (pose->flags & (HAUSTRA_POSE_VALID | HAUSTRA_POSE_PREDICTED)) == HAUSTRA_POSE_VALID &&
         haustra_now_ns() - pose->captured_ns <= max_age_ns;
}

static inline const char* haustra_state_name(uint32_t state) {
  static const char* const names[] = {"initialising", "tracking", "lost"};
  return state < sizeof names / sizeof names[0] ? names[state] : "unknown";
}

static inline const char* haustra_reason_name(uint32_t reason) {
  static const char* const names[] = {
      "tracked",       "recovered",     "relocalised",         "damaged_frame", "few_features", "few_matches",
      "few_inliers",   "weak_evidence", "inconsistent_motion", "first_view",    "low_parallax", "no_epipolar_geometry",
      "low_spread",    "map_proposed",  "awaiting_map",        "predicted",     "no_time",      "uncertain_motion",
      "denied_by_flow"};
  return reason < sizeof names / sizeof names[0] ? names[reason] : "unknown";
}

static inline const char* haustra_mark_state_name(uint32_t state) {
  static const char* const names[] = {"out_of_view", "in_front", "hidden", "unsure"};
  return state < sizeof names / sizeof names[0] ? names[state] : "unknown";
}

static inline const char* haustra_service_name(uint32_t service) {
  static const char* const names[] = {"starting", "idle", "running", "no_signal", "source_over", "closed"};
  return service < sizeof names / sizeof names[0] ? names[service] : "unknown";
}

static inline const char* haustra_event_name(uint32_t kind) {
  static const char* const names[] = {"map_created", "map_refused",    "map_dropped", "map_stored",      "merged",
                                      "loop_closed", "merge_rejected", "frame_found", "frame_not_found", "map_evicted"};
  if (kind == HAUSTRA_EVENT_PROCEDURE_BEGUN) return "procedure_begun";
  if (kind == HAUSTRA_EVENT_PROCEDURE_ENDED) return "procedure_ended";
  return kind < sizeof names / sizeof names[0] ? names[kind] : "unknown";
}

#ifdef __cplusplus
}
#endif

#endif /* HAUSTRA_POSE_RING_H_ */
