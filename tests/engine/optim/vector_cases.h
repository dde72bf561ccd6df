// The cases of the tests of vector passes: every instruction set that this machine has, with every kind of camera.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "engine/camera/camera_model.h"
#include "engine/optim/vector_level.h"

namespace haustra::test {

inline CameraModel CameraOfKind(CameraModelKind kind) {
  CameraCalibration c;
  c.kind = kind;
  c.width_px = 720;
  c.height_px = 540;
  c.fx = 340.0;
  c.fy = 343.0;
  c.cx = 361.0;
  c.cy = 268.0;
  switch (kind) {
    case CameraModelKind::kPinhole: c.coefficients = {-0.21, 0.06, 0.0007, -0.0004, -0.008}; break;
    case CameraModelKind::kKannalaBrandt: c.coefficients = {-0.02, 0.004, -0.001, 0.0001}; break;
    case CameraModelKind::kOcamCalib: c.coefficients = {235.0, -1.6e-3, 1.1e-6, -2.4e-9, 1.0008, 3e-4, -2e-4}; break;
  }
  return CameraModel::Create(c).value();
}

struct VectorCase {
  optim::VectorLevel level;
  CameraModelKind kind;
};
inline std::vector<VectorCase> SupportedVectorCases() {
  std::vector<VectorCase> cases;
  for (const auto level : {optim::VectorLevel::kPortable, optim::VectorLevel::kAvx2}) {
    if (!optim::IsSupported(level)) continue;
    for (const auto kind : {CameraModelKind::kPinhole, CameraModelKind::kKannalaBrandt, CameraModelKind::kOcamCalib}) {
      cases.push_back({level, kind});
    }
  }
  return cases;
}
inline std::string VectorCaseName(const ::testing::TestParamInfo<VectorCase>& info) {
  const std::string level = info.param.level == optim::VectorLevel::kAvx2 ? "Avx2" : "Portable";
  switch (info.param.kind) {
    case CameraModelKind::kPinhole: return level + "Pinhole";
    case CameraModelKind::kKannalaBrandt: return level + "KannalaBrandt";
    case CameraModelKind::kOcamCalib: return level + "OcamCalib";
  }
  return level;
}

}  // namespace haustra::test
