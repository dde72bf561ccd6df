/* SPDX-License-Identifier: Apache-2.0 */
/* The header of pictures and matched points as a C client sees it: compiled, nothing more. */
#include "haustra_pose_ring.h"
#include "haustra_view_ring.h"
