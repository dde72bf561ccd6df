// The atlas file: a chunk file (chunk_file.h) with these sections in this order. idx: position in the section(s)
// before; pose: quaternion x y z w and translation, f64; vector: three f64; numbers in units and frames of
// engine/atlas/atlas.h.
//
//   IDEN  camera: u32 kind, i32 width, i32 height, f64 fx fy cx cy, 8 x f64 coefficients, f64 rate_hz, f64
//         max_half_angle_deg; u32 bytes of a descriptor (128), u32 root_sift (0, 1)
//   CONT  u32 next keyframe id, next point id, next map id, next session, number of maps, keyframes, points, traces
//   MAPS  each: u32 id
//   KEYF  one section a keyframe: u32 id, session, frame index, i64 time stamp (ns), u32 map idx, pose cam_from_map,
//   f64
//         scale, u32 number of features; keypoints: f32 x y scale angle response, i32 octave; descriptors: 128 bytes
//         each
//   PNTS  up to 4096 points a section, each: u32 id, map idx, vector position, vector normal, f64 scale_times_distance,
//         u32 first keyframe id, u32 keyframe idx and i32 feature of the descriptor, u32 number of observations; each:
//         u32 keyframe idx, i32 feature
//   TRAC  each: u32 id, session, frame index, id of the stand-in, pose cam_from_stand_in, f64 stand_in_scale, scale
//   MARK  only where a mark was ever set: u32 next mark id; each: u32 id, 32 bytes label, filled with zeros, u32
//   session,
//         frame index, i64 time stamp (ns), u32 keyframe idx, vector point_in_anchor, vector normal_in_anchor, f64
//         radius, scale
//
// Maps, keyframes, points, traces and marks are in order of their ids. An atlas without content has IDEN, CONT, MAPS
// and TRAC.
#pragma once

#include "engine/io/chunk_file.h"

namespace haustra {

// The first byte is no text and the line ends show what a transfer as text does to them.
inline constexpr ChunkFileKind kAtlasFileKind{"atlas file", "\x8aHATL\r\n\x1a", 1};

inline constexpr std::string_view kIdentityTag = "IDEN";
inline constexpr std::string_view kContentsTag = "CONT";
inline constexpr std::string_view kMapsTag = "MAPS";
inline constexpr std::string_view kKeyframeTag = "KEYF";
inline constexpr std::string_view kPointsTag = "PNTS";
inline constexpr std::string_view kTracesTag = "TRAC";
inline constexpr std::string_view kMarksTag = "MARK";

inline constexpr std::size_t kPointsPerSection = 4096;

}  // namespace haustra
