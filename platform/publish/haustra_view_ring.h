/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the scope sees, small, and where tracking has found points of the map in it: C11 (or C++) reader of a second
 * shared-memory file that haustrad writes beside the poses when publish.view is true. Made for `haustra view`.
 *
 * It holds pictures of a patient: whoever may read the poses may read them. At the end of a procedure they are wiped.
 *
 * What holds:
 *   - The writers never wait for a reader and never look at one. A reader gets whole records or none.
 *   - A picture is published when its frame is captured, at most ten times a second; matches when it was answered.
 *     They belong together when frame_index and procedure agree.
 *   - A picture holds every n-th pixel of every n-th row of its frame, n the smallest that fits.
 *   - When the daemon stops or starts anew, the file is replaced as that of the poses is:
 *     haustra_view_is_replaced() says when to open again.
 *
 * Errors of the functions are those of haustra_pose_ring.h. No function allocates, except that open maps the file.
 */
#ifndef HAUSTRA_VIEW_RING_H_
#define HAUSTRA_VIEW_RING_H_

#include "haustra_pose_ring.h" /* lies beside this file */

#ifdef __cplusplus
extern "C" {
#endif

#define HAUSTRA_VIEW_MAGIC UINT64_C(0x7661727473756168) /* "haustrav" */
/* Changes whenever the layout does. */
#define HAUSTRA_VIEW_VERSION 1u

#define HAUSTRA_PICTURE_SLOTS 4u
#define HAUSTRA_PICTURE_MAX_WIDTH 480u
#define HAUSTRA_PICTURE_MAX_HEIGHT 480u
#define HAUSTRA_PICTURE_MAX_BYTES (3u * HAUSTRA_PICTURE_MAX_WIDTH * HAUSTRA_PICTURE_MAX_HEIGHT)
#define HAUSTRA_MATCHES_SLOTS 64u
#define HAUSTRA_MATCHES_POINTS 1024u /* of more, an even selection */

struct haustra_picture {
  uint64_t sequence; /* counts from 1 over the life of the file */
  int64_t published_ns;
  uint64_t frame_index;
  uint64_t procedure;
  uint32_t step;                             /* of the frame every step-th pixel of every step-th row */
  uint32_t width, height;                    /* of this picture, px */
  uint32_t num_channels;                     /* 1: grey; 3: blue, green, red */
  uint8_t pixels[HAUSTRA_PICTURE_MAX_BYTES]; /* height rows of width * num_channels bytes */
};

struct haustra_match {
  float x_px, y_px; /* in the frame; pixel centres at integers */
};

struct haustra_matches {
  uint64_t sequence; /* counts from 1 over the life of the file */
  uint64_t frame_index;
  uint64_t procedure;
  uint32_t num_points;  /* in points[] */
  uint32_t num_matched; /* features of the frame that agree with its pose; 0 without one */
  struct haustra_match points[HAUSTRA_MATCHES_POINTS];
};

/* ---- Layout of the file: as in haustra_pose_ring.h. ---- */

struct haustra_picture_slot {
  uint64_t lock;
  struct haustra_picture record;
};
struct haustra_matches_slot {
  uint64_t lock;
  struct haustra_matches record;
};

struct haustra_view_header {
  uint64_t magic;
  uint32_t version;
  uint32_t header_bytes;
  uint64_t file_bytes;
  uint32_t picture_slot_bytes, num_picture_slots;
  uint32_t matches_slot_bytes, num_matches_slots;
  uint64_t reserved[3];
  uint64_t newest_picture __attribute__((aligned(64))); /* written by the capture thread alone */
  uint64_t reserved_too[7];
  uint64_t newest_matches; /* written by the tracking thread alone */
  uint64_t reserved_three[7];
};

struct haustra_view_file {
  struct haustra_view_header header;
  struct haustra_picture_slot pictures[HAUSTRA_PICTURE_SLOTS];
  struct haustra_matches_slot matches[HAUSTRA_MATCHES_SLOTS];
};

HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_picture) % 8 == 0, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_matches) == 32 + 8 * HAUSTRA_MATCHES_POINTS, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_view_header) == 192, "layout");

struct haustra_view {
  const struct haustra_view_file* file;
  uint64_t device, inode; /* of the file that is open */
};

/* ---- Functions ---- */

/* HAUSTRA_NO_FILE, HAUSTRA_NOT_A_RING, HAUSTRA_OTHER_VERSION; `view` is empty then. */
static inline int haustra_view_open(struct haustra_view* view, const char* path) {
  struct stat info;
  struct haustra_view_header header;
  void* memory;
  ssize_t count;
  int file;
  memset(view, 0, sizeof *view);
  file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return HAUSTRA_NO_FILE;
  count = read(file, &header, sizeof header);
  if (fstat(file, &info) != 0 || !S_ISREG(info.st_mode) || count < 16 || header.magic != HAUSTRA_VIEW_MAGIC) {
    close(file);
    return HAUSTRA_NOT_A_RING;
  }
  if (header.version != HAUSTRA_VIEW_VERSION) {
    close(file);
    return HAUSTRA_OTHER_VERSION;
  }
  if (count < (ssize_t)sizeof header || header.header_bytes != sizeof header ||
      header.file_bytes != sizeof(struct haustra_view_file) || (uint64_t)info.st_size < header.file_bytes ||
      header.picture_slot_bytes != sizeof(struct haustra_picture_slot) ||
      header.num_picture_slots != HAUSTRA_PICTURE_SLOTS ||
      header.matches_slot_bytes != sizeof(struct haustra_matches_slot) ||
      header.num_matches_slots != HAUSTRA_MATCHES_SLOTS) {
    close(file);
    return HAUSTRA_NOT_A_RING;
  }
  memory = mmap(NULL, sizeof(struct haustra_view_file), PROT_READ, MAP_SHARED, file, 0);
  close(file);
  if (memory == MAP_FAILED) return HAUSTRA_NO_FILE;
  view->file = (const struct haustra_view_file*)memory;
  view->device = (uint64_t)info.st_dev;
  view->inode = (uint64_t)info.st_ino;
  return HAUSTRA_OK;
}

static inline void haustra_view_close(struct haustra_view* view) {
  if (view->file != NULL) munmap((void*)(uintptr_t)view->file, sizeof(struct haustra_view_file));
  memset(view, 0, sizeof *view);
}

/* 1 when another file has the name now, or none has: close, and open again when there is one. */
static inline int haustra_view_is_replaced(const struct haustra_view* view, const char* path) {
  struct stat info;
  if (stat(path, &info) != 0) return 1;
  return (uint64_t)info.st_dev != view->device || (uint64_t)info.st_ino != view->inode;
}

/* The newest picture into a buffer of the caller's (about 700 kB: not on a small stack). HAUSTRA_NOT_YET, HAUSTRA_BUSY.
   width, height and num_channels are within the bounds of pixels[]. */
static inline int haustra_view_latest_picture(const struct haustra_view* view, struct haustra_picture* picture) {
  int attempt;
  uint64_t newest = 0;
  for (attempt = 0; attempt < 8; ++attempt) {
    newest = haustra_load_(&view->file->header.newest_picture);
    if (newest == 0) return HAUSTRA_NOT_YET;
    if (haustra_read_slot_(&view->file->pictures[newest % HAUSTRA_PICTURE_SLOTS].lock, newest, picture,
                           sizeof *picture) != HAUSTRA_OK) {
      continue;
    }
    if (picture->width > HAUSTRA_PICTURE_MAX_WIDTH || picture->height > HAUSTRA_PICTURE_MAX_HEIGHT ||
        (picture->num_channels != 1 && picture->num_channels != 3)) {
      return HAUSTRA_NOT_A_RING;
    }
    return HAUSTRA_OK;
  }
  return haustra_load_(&view->file->pictures[newest % HAUSTRA_PICTURE_SLOTS].lock) == 0 ? HAUSTRA_NOT_YET
                                                                                        : HAUSTRA_BUSY;
}

/* The matches of a frame. HAUSTRA_NOT_YET: it was not answered; HAUSTRA_OVERRUN: it was, or a later one, and the
   matches can no longer be had. num_points is within the bounds of points[]. */
static inline int haustra_view_matches_of(const struct haustra_view* view, uint64_t frame_index, uint64_t procedure,
                                          struct haustra_matches* matches) {
  const uint64_t newest = haustra_load_(&view->file->header.newest_matches);
  uint64_t sequence;
  for (sequence = newest; sequence > 0 && sequence + HAUSTRA_MATCHES_SLOTS > newest; --sequence) {
    if (haustra_read_slot_(&view->file->matches[sequence % HAUSTRA_MATCHES_SLOTS].lock, sequence, matches,
                           sizeof *matches) != HAUSTRA_OK) {
      continue;
    }
    if (matches->procedure != procedure || matches->frame_index < frame_index) break;
    if (matches->frame_index == frame_index) {
      return matches->num_points <= HAUSTRA_MATCHES_POINTS ? HAUSTRA_OK : HAUSTRA_NOT_A_RING;
    }
  }
  return sequence < newest ? HAUSTRA_OVERRUN : HAUSTRA_NOT_YET;
}

#ifdef __cplusplus
}
#endif

#endif /* HAUSTRA_VIEW_RING_H_ */
