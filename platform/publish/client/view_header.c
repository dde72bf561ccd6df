/* SPDX-License-Identifier: Apache-2.0 */
/* The headers of pictures with matched points and of depths as a C client sees them: compiled, nothing more. */
#include "haustra_depth_table.h"
#include "haustra_pose_ring.h"
#include "haustra_view_ring.h"
