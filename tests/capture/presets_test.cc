// Every camera preset loads, and says what its data set's publication says.
#include <cmath>
#include <filesystem>
#include <map>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/calibration_reader.h"

namespace haustra {
namespace {

using ::testing::ElementsAre;

const std::filesystem::path kFolder = std::filesystem::path(HAUSTRA_SOURCE_DIR) / "config" / "cameras";

CameraCalibration Load(const std::string& name) {
  const Result<CameraCalibration> calibration = ReadCalibration((kFolder / (name + ".yaml")).string());
  EXPECT_TRUE(calibration.ok()) << calibration.status().ToString();
  return calibration.ok() ? *calibration : CameraCalibration();
}

TEST(CameraPresets, AllLoad) {
  int num_presets = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
    const Result<CameraCalibration> calibration = ReadCalibration(entry.path().string());
    EXPECT_TRUE(calibration.ok()) << calibration.status().ToString();
    ++num_presets;
  }
  EXPECT_GE(num_presets, 7);
}

TEST(CameraPresets, C3vdIsAsPublished) {
  const CameraCalibration v1 = Load("c3vd_v1_ocamcalib");
  EXPECT_EQ(v1.kind, CameraModelKind::kOcamCalib);
  EXPECT_EQ(v1.width_px, 1350);
  EXPECT_EQ(v1.height_px, 1080);
  EXPECT_EQ(v1.rate_hz, 29.97);
  EXPECT_EQ(v1.cx, 678.544839);
  EXPECT_EQ(v1.cy, 542.975888);
  EXPECT_THAT(v1.coefficients,
              ElementsAre(769.243600037458, -8.12770624150226e-4, 6.25674244578925e-7, -1.19662182144280e-9,
                          0.99998688224999, 0.00288273829525059, -0.00296316513429569, 0));
  const CameraCalibration v2 = Load("c3vd_v2_ocamcalib");
  EXPECT_EQ(v2.cx, 677.739464);
  EXPECT_EQ(v2.cy, 543.057998);
  EXPECT_THAT(v2.coefficients, ElementsAre(767.733695862103, -5.92506426558248e-4, -2.69440266600040e-7,
                                           -2.16380341010063e-10, 0.9999, 1.10e-4, -1.83e-4, 0));
}

TEST(CameraPresets, EndomapperIsAsPublished) {
  const CameraCalibration c = Load("endomapper_hculb_00039");
  EXPECT_EQ(c.kind, CameraModelKind::kKannalaBrandt);
  EXPECT_EQ(c.width_px, 1440);
  EXPECT_EQ(c.height_px, 1080);
  EXPECT_EQ(c.rate_hz, 50.0);
  EXPECT_EQ(c.fx, 717.2104);
  EXPECT_EQ(c.fy, 717.4816);
  EXPECT_EQ(c.cx, 735.3566);
  EXPECT_EQ(c.cy, 552.7982);
  EXPECT_THAT(c.coefficients, ElementsAre(-0.1389272, -0.001239606, 0.0009125824, -4.071615e-05, 0, 0, 0, 0));
  EXPECT_EQ(Load("endomapper_hculb_00044").fy, 735.719);
  EXPECT_EQ(Load("endomapper_seq_035").coefficients[3], -6.998448e-05);
}

TEST(CameraPresets, KannalaBrandtFitsAgreeWithThePublishedPolynomials) {
  for (const auto& [version, max_error_px] : std::map<std::string, double>{{"v1", 1.2}, {"v2", 0.6}}) {
    const CameraCalibration ocam = Load("c3vd_" + version + "_ocamcalib");
    const CameraCalibration fit = Load("c3vd_" + version + "_kannala_brandt");
    EXPECT_EQ(fit.cx, ocam.cx);
    EXPECT_EQ(fit.cy, ocam.cy);
    const auto& a = ocam.coefficients;
    const auto& k = fit.coefficients;
    for (double rho = 1.0; rho <= 870.0; rho += 1.0) {
      const double z = a[0] + rho * rho * (a[1] + rho * (a[2] + rho * a[3]));
      const double theta = std::atan2(rho, z);
      const double t2 = theta * theta;
      const double r = fit.fx * theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
      ASSERT_NEAR(r, rho, max_error_px) << version;
    }
  }
}

}  // namespace
}  // namespace haustra
