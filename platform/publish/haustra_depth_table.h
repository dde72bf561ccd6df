/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the keyframes of all maps see, in depth: C11 (or C++) reader of a third shared-memory file that haustrad writes
 * beside the poses when publish.depth is true. Who reads it can make the surface of the wall while the scope moves, and
 * say what of it was not looked at, as `haustra view` does.
 *
 *     struct haustra_depth_table table;
 *     if (haustra_depth_open(&table, "/run/haustra/depth") != HAUSTRA_OK) ...
 *     haustra_depth_read_camera(&table, &camera);
 *     for (slot = 0; slot < table.num_slots; ++slot) {
 *       if (haustra_depth_read_keyframe(&table, slot, &keyframe) != HAUSTRA_OK) continue;
 *       ... keyframe.position_mu, keyframe.orientation_xyzw ...
 *       if (keyframe.depth != 0) haustra_depth_read(&table, slot, keyframe.depth, &depth);
 *     }
 *
 * What holds:
 *   - The writer never waits for a reader and never looks at one. A reader gets whole records or none.
 *   - A slot belongs to one keyframe until that goes; then it is empty, or another one's. Keyframes move with every
 *     bundle, and with joins to another map: the record comes anew, the depth stays what it was. Where a young map is
 *     built anew the depth goes, and may come again as another one.
 *   - The table is some hundreds of milliseconds behind the poses (publish.snapshot_interval_ms), and may be read while
 *     it is written: where a map was moved as a whole map_epoch tells records of before and after apart.
 *   - It holds colours of a patient's colon: whoever may read the poses may read them. At the end of a procedure they
 *     are wiped. When the daemon stops or starts anew the file is replaced: haustra_depth_is_replaced().
 *
 * Errors of the functions are those of haustra_pose_ring.h. No function allocates, except that open maps the file.
 */
#ifndef HAUSTRA_DEPTH_TABLE_H_
#define HAUSTRA_DEPTH_TABLE_H_

#include "haustra_pose_ring.h" /* lies beside this file */

#ifdef __cplusplus
extern "C" {
#endif

#define HAUSTRA_DEPTH_MAGIC UINT64_C(0x6461727473756168) /* "haustrad" */
/* Changes whenever the layout does. */
#define HAUSTRA_DEPTH_VERSION 1u

#define HAUSTRA_DEPTH_MAX_CELLS 6912u /* 96x72 */

/* Formulas: hal/camera_calibration.h of the sources. */
enum haustra_camera_model {
  HAUSTRA_CAMERA_PINHOLE = 0,        /* coefficients k1 k2 p1 p2 k3 */
  HAUSTRA_CAMERA_KANNALA_BRANDT = 1, /* k1 k2 k3 k4 */
  HAUSTRA_CAMERA_OCAM_CALIB = 2      /* a0 a2 a3 a4 c d e */
};

/* The camera of the procedure, and the grid that its depths have. Pixel centres lie at integers. */
struct haustra_depth_camera {
  uint64_t sequence; /* grows over the life of the file; no other record of it has the same */
  uint64_t procedure;
  uint32_t model; /* enum haustra_camera_model */
  uint32_t width_px, height_px;
  uint32_t step_px;                 /* from one cell to the next; the first one covers step_px x step_px pixels */
  uint32_t grid_width, grid_height; /* cells; no more than HAUSTRA_DEPTH_MAX_CELLS in all */
  double fx, fy, cx, cy;
  double coefficients[8];
  double max_half_angle_deg;                 /* 0: as far as the model is monotonic */
  uint8_t is_scene[HAUSTRA_DEPTH_MAX_CELLS]; /* by rows: whether the picture shows the scene there */
};

/* Where a keyframe stands. */
struct haustra_depth_keyframe {
  uint64_t sequence; /* as of the camera */
  uint64_t procedure;
  uint64_t map_epoch; /* as that of the poses */
  int64_t source_ns;  /* time stamp of its frame, on the source's own clock */
  uint32_t keyframe_id;
  uint32_t frame_index;
  uint32_t map_id;
  uint32_t is_of_this_run; /* 0: it came with an atlas that was loaded; frame and time are of that procedure */
  double position_mu[3];   /* map_from_cam, as in haustra_pose */
  double orientation_xyzw[4];
  uint64_t depth;            /* sequence of its depth; 0: it has none yet */
  double inverse_range_unit; /* of code 1, 1 / map units, at the map's present scale */
  /* Product of the changes of the map's unit so far: a length beside this keyframe that was L when this was S is
     L * scale / S now. */
  double scale;
};

/* By rows, one entry a cell. */
struct haustra_depth {
  uint64_t sequence;                            /* as of the camera */
  uint64_t num_cells;                           /* that are meaningful */
  uint16_t codes[HAUSTRA_DEPTH_MAX_CELLS];      /* inverse distance from the camera along the ray of the middle of the
                                                   cell, in units of inverse_range_unit; 0: not known */
  uint8_t confidences[HAUSTRA_DEPTH_MAX_CELLS]; /* 255: sure */
  uint8_t bgr[3u * HAUSTRA_DEPTH_MAX_CELLS];    /* blue, green, red of the picture there */
};

/* ---- Layout of the file: header, camera, num_slots keyframes, num_slots depths; each behind a lock word as in
   haustra_pose_ring.h. ---- */

struct haustra_depth_camera_slot {
  uint64_t lock;
  struct haustra_depth_camera record;
};
struct haustra_depth_keyframe_slot {
  uint64_t lock;
  struct haustra_depth_keyframe record;
};
struct haustra_depth_slot {
  uint64_t lock;
  struct haustra_depth record;
};

struct haustra_depth_header {
  uint64_t magic;
  uint32_t version;
  uint32_t header_bytes;
  uint64_t file_bytes;
  uint32_t num_slots; /* keyframes that the atlas has room for */
  uint32_t camera_slot_bytes, keyframe_slot_bytes, depth_slot_bytes;
  uint64_t num_changes; /* sequence of the newest record; a wipe counts as one */
  uint64_t reserved[2];
};

HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_depth_camera) % 8 == 0, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_depth_keyframe) == 128, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_depth) == 16 + 6 * HAUSTRA_DEPTH_MAX_CELLS, "layout");
HAUSTRA_STATIC_ASSERT(sizeof(struct haustra_depth_header) == 64, "layout");

struct haustra_depth_table {
  const struct haustra_depth_header* header;
  const struct haustra_depth_camera_slot* camera;
  const struct haustra_depth_keyframe_slot* keyframes;
  const struct haustra_depth_slot* depths;
  uint32_t num_slots;
  uint64_t file_bytes;
  uint64_t device, inode; /* of the file that is open */
};

/* ---- Functions ---- */

static inline uint64_t haustra_depth_file_bytes(uint32_t num_slots) {
  return sizeof(struct haustra_depth_header) + sizeof(struct haustra_depth_camera_slot) +
         num_slots * (uint64_t)(sizeof(struct haustra_depth_keyframe_slot) + sizeof(struct haustra_depth_slot));
}

/* Whether this is the head of such a file, and of this layout: HAUSTRA_OK, HAUSTRA_NOT_A_RING, HAUSTRA_OTHER_VERSION.
   `num_bytes` were read of it; the file has `file_bytes`. */
static inline int haustra_depth_check_(const struct haustra_depth_header* header, int64_t num_bytes,
                                       uint64_t file_bytes) {
  if (num_bytes < 16 || header->magic != HAUSTRA_DEPTH_MAGIC) return HAUSTRA_NOT_A_RING;
  if (header->version != HAUSTRA_DEPTH_VERSION) return HAUSTRA_OTHER_VERSION;
  if (num_bytes < (int64_t)sizeof *header || header->header_bytes != sizeof *header ||
      header->camera_slot_bytes != sizeof(struct haustra_depth_camera_slot) ||
      header->keyframe_slot_bytes != sizeof(struct haustra_depth_keyframe_slot) ||
      header->depth_slot_bytes != sizeof(struct haustra_depth_slot) ||
      header->file_bytes != haustra_depth_file_bytes(header->num_slots) || file_bytes < header->file_bytes) {
    return HAUSTRA_NOT_A_RING;
  }
  return HAUSTRA_OK;
}

/* HAUSTRA_NO_FILE, HAUSTRA_NOT_A_RING, HAUSTRA_OTHER_VERSION; `table` is empty then. */
static inline int haustra_depth_open(struct haustra_depth_table* table, const char* path) {
  struct stat info;
  struct haustra_depth_header header;
  const char* memory;
  void* mapped;
  ssize_t count;
  int file, result;
  memset(table, 0, sizeof *table);
  memset(&header, 0, sizeof header);
  file = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (file < 0) return HAUSTRA_NO_FILE;
  count = read(file, &header, sizeof header);
  if (fstat(file, &info) != 0 || !S_ISREG(info.st_mode)) {
    close(file);
    return HAUSTRA_NOT_A_RING;
  }
  result = haustra_depth_check_(&header, count, (uint64_t)info.st_size);
  if (result != HAUSTRA_OK) {
    close(file);
    return result;
  }
  mapped = mmap(NULL, (size_t)header.file_bytes, PROT_READ, MAP_SHARED, file, 0);
  close(file);
  if (mapped == MAP_FAILED) return HAUSTRA_NO_FILE;
  memory = (const char*)mapped;
  table->header = (const struct haustra_depth_header*)(const void*)memory;
  memory += sizeof(struct haustra_depth_header);
  table->camera = (const struct haustra_depth_camera_slot*)(const void*)memory;
  memory += sizeof(struct haustra_depth_camera_slot);
  table->keyframes = (const struct haustra_depth_keyframe_slot*)(const void*)memory;
  memory += header.num_slots * sizeof(struct haustra_depth_keyframe_slot);
  table->depths = (const struct haustra_depth_slot*)(const void*)memory;
  table->num_slots = header.num_slots;
  table->file_bytes = header.file_bytes;
  table->device = (uint64_t)info.st_dev;
  table->inode = (uint64_t)info.st_ino;
  return HAUSTRA_OK;
}

static inline void haustra_depth_close(struct haustra_depth_table* table) {
  if (table->header != NULL) munmap((void*)(uintptr_t)table->header, (size_t)table->file_bytes);
  memset(table, 0, sizeof *table);
}

/* 1 when another file has the name now, or none has: close, and open again when there is one. */
static inline int haustra_depth_is_replaced(const struct haustra_depth_table* table, const char* path) {
  struct stat info;
  if (stat(path, &info) != 0) return 1;
  return (uint64_t)info.st_dev != table->device || (uint64_t)info.st_ino != table->inode;
}

/* Grows when any record has changed: while it stays there is nothing new to read. */
static inline uint64_t haustra_depth_num_changes(const struct haustra_depth_table* table) {
  return haustra_load_(&table->header->num_changes);
}

/* The record behind `lock`, whichever it is. HAUSTRA_NOT_YET: empty. HAUSTRA_BUSY: it was being written. */
static inline int haustra_depth_read_any_(const uint64_t* lock, void* record, size_t num_bytes) {
  int attempt;
  for (attempt = 0; attempt < 8; ++attempt) {
    const uint64_t locked = haustra_load_(lock);
    if (locked == 0) return HAUSTRA_NOT_YET;
    if (locked % 2 == 0 && haustra_read_slot_(lock, locked / 2, record, num_bytes) == HAUSTRA_OK) return HAUSTRA_OK;
  }
  return HAUSTRA_BUSY;
}

/* HAUSTRA_NOT_YET before the first procedure and after a wipe, HAUSTRA_BUSY. The grid is within its bounds. */
static inline int haustra_depth_read_camera(const struct haustra_depth_table* table,
                                            struct haustra_depth_camera* camera) {
  const int result = haustra_depth_read_any_(&table->camera->lock, camera, sizeof *camera);
  if (result != HAUSTRA_OK) return result;
  if (camera->step_px == 0 || camera->grid_width == 0 || camera->grid_height == 0 ||
      (uint64_t)camera->grid_width * camera->grid_height > HAUSTRA_DEPTH_MAX_CELLS) {
    return HAUSTRA_NOT_A_RING;
  }
  return HAUSTRA_OK;
}

/* slot < table->num_slots. HAUSTRA_NOT_YET: no keyframe there, HAUSTRA_BUSY. */
static inline int haustra_depth_read_keyframe(const struct haustra_depth_table* table, uint32_t slot,
                                              struct haustra_depth_keyframe* keyframe) {
  return haustra_depth_read_any_(&table->keyframes[slot].lock, keyframe, sizeof *keyframe);
}

/* The depth of that sequence; 41 kB, not for a small stack. HAUSTRA_OVERRUN: it is another one by now. num_cells is
   within the bounds. */
static inline int haustra_depth_read(const struct haustra_depth_table* table, uint32_t slot, uint64_t sequence,
                                     struct haustra_depth* depth) {
  const int result = haustra_read_slot_(&table->depths[slot].lock, sequence, depth, sizeof *depth);
  if (result != HAUSTRA_OK) return result;
  return depth->num_cells <= HAUSTRA_DEPTH_MAX_CELLS ? HAUSTRA_OK : HAUSTRA_NOT_A_RING;
}

#ifdef __cplusplus
}
#endif

#endif /* HAUSTRA_DEPTH_TABLE_H_ */
