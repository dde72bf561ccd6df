#include "capture/calibration_reader.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/capture/temp_folder.h"

namespace haustra {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr std::string_view kPinholeSettings =
    "%YAML:1.0\n"
    "# Frames are undistorted: pinhole, pixel centres at integers\n"
    "Camera.type: \"PinHole\"\n"
    "Camera.fx: 333.107\n"
    "Camera.fy: 333.107\n"
    "Camera.cx: 269.5105\n"
    "Camera.cy: 270.8205\n"
    "Camera.k1: 0.1\n"
    "Camera.k2: -0.2\n"
    "Camera.p1: 0.003\n"
    "Camera.p2: -0.004\n"
    "Camera.width: 540\n"
    "Camera.height: 540\n"
    "Camera.fps: 30\n"
    "Camera.RGB: 1\n";

constexpr std::string_view kOcam =
    "# a comment\n"
    "model: ocamcalib\n"
    "width_px: 1350\n"
    "height_px: 1080\n"
    "rate_hz: 29.97\n"
    "max_half_angle_deg: 85\n"
    "intrinsics: {cx: 678.5, cy: 542.9}\n"
    "coefficients:\n"
    "  a0: 769.2\n"
    "  a2: -8.1e-4\n"
    "  a3: 6.2e-7\n"
    "  a4: -1.2e-9\n"
    "  c: 0.9999\n"
    "  d: 0.0028\n"
    "  e: -0.0029\n";

constexpr std::string_view kOpencv =
    "%YAML:1.0\n"
    "---\n"
    "calibration_time: \"Mon Jan  1 12:00:00 2024\"\n"
    "model: fisheye\n"
    "image_width: 640\n"
    "image_height: 480\n"
    "camera_matrix: !!opencv-matrix\n"
    "   rows: 3\n"
    "   cols: 3\n"
    "   dt: d\n"
    "   data: [ 500., 0., 319.5, 0., 501., 239.5, 0., 0., 1. ]\n"
    "distortion_coefficients: !!opencv-matrix\n"
    "   rows: 4\n"
    "   cols: 1\n"
    "   dt: d\n"
    "   data: [ -1.0000000000000001e-01, 2.0e-02, -3.0e-03,\n"
    "       4.0e-04 ]\n"
    "avg_reprojection_error: 2.5e-01\n";

constexpr std::string_view kKalibr =
    "cam0:\n"
    "  cam_overlaps: []\n"
    "  camera_model: pinhole\n"
    "  distortion_coeffs: [-0.1, 0.02, -0.003, 0.0004]\n"
    "  distortion_model: equidistant\n"
    "  intrinsics: [500.0, 501.0, 319.5, 239.5]\n"
    "  resolution: [640, 480]\n"
    "  rostopic: /cam0/image_raw\n";

constexpr std::string_view kEuroc =
    "# General sensor definitions.\n"
    "sensor_type: camera\n"
    "comment: VI-Sensor cam0\n"
    "T_BS:\n"
    "  cols: 4\n"
    "  rows: 4\n"
    "  data: [1.0, 0.0, 0.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n"
    "rate_hz: 20\n"
    "resolution: [752, 480]\n"
    "camera_model: pinhole\n"
    "intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv\n"
    "distortion_model: radial-tangential\n"
    "distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]\n";

constexpr std::string_view kCalibu =
    "<rig>\n"
    "    <camera>\n"
    "        <camera_model name=\"\" index=\"0\" serialno=\"0\" type=\"calibu_fu_fv_u0_v0_kb4\" version=\"0\">\n"
    "            <width> 1440 </width>\n"
    "            <height> 1080 </height>\n"
    "            <!-- Use RDF matrix, [right down forward], to define the coordinate frame convention -->\n"
    "            <right> [ 1; 0; 0 ] </right>\n"
    "            <down> [ 0; 1; 0 ] </down>\n"
    "            <forward> [ 0; 0; 1 ] </forward>\n"
    "            <!-- Camera parameters ordered as per type name. -->\n"
    "            <params> [ 717.2104;  717.4816;  735.3566;  552.7982; -0.1389272; -0.001239606; 0.0009125824; "
    "-4.071615e-05 ] </params>\n"
    "        </camera_model>\n"
    "        <pose>\n"
    "            <T_wc> [ 1, 0, 0, 0; 0, 1, 0, 0; 0, 0, 1, 0 ] </T_wc>\n"
    "        </pose>\n"
    "    </camera>\n"
    "</rig>\n";

class CalibrationReaderTest : public ::testing::Test {
 protected:
  Result<CameraCalibration> ReadText(std::string_view text) {
    return ReadCalibration(folder_.Write("calib.yaml", text));
  }
  // Expects kInvalidArgument and returns the message without the folder's path.
  std::string MessageOf(std::string_view text) {
    const Result<CameraCalibration> calibration = ReadText(text);
    EXPECT_EQ(calibration.code(), StatusCode::kInvalidArgument) << text;
    const std::string message = calibration.status().message();
    EXPECT_TRUE(message.starts_with(folder_.path() + "/")) << message;
    return message.starts_with(folder_.path()) ? message.substr(folder_.path().size() + 1) : message;
  }

  TempFolder folder_;
};

TEST_F(CalibrationReaderTest, SettingsGiveKannalaBrandt) {
  const Result<CameraCalibration> c = ReadText(kSmallCalibration);
  ASSERT_TRUE(c.ok()) << c.status().ToString();
  EXPECT_EQ(c->kind, CameraModelKind::kKannalaBrandt);
  EXPECT_EQ(c->width_px, 64);
  EXPECT_EQ(c->height_px, 48);
  EXPECT_EQ(c->fx, 40.5);
  EXPECT_EQ(c->fy, 40.25);
  EXPECT_EQ(c->cx, 31.5);
  EXPECT_EQ(c->cy, 24.5);
  EXPECT_THAT(c->coefficients, ElementsAre(-0.045, 0.008, -0.0031, 0.0005, 0, 0, 0, 0));
  EXPECT_EQ(c->rate_hz, 25.0);
  EXPECT_EQ(c->max_half_angle_deg, 0.0);
}

TEST_F(CalibrationReaderTest, SettingsGivePinhole) {
  const Result<CameraCalibration> c = ReadText(kPinholeSettings);
  ASSERT_TRUE(c.ok()) << c.status().ToString();
  EXPECT_EQ(c->kind, CameraModelKind::kPinhole);
  EXPECT_THAT(c->coefficients, ElementsAre(0.1, -0.2, 0.003, -0.004, 0, 0, 0, 0));
  EXPECT_EQ(c->rate_hz, 30.0);
}

TEST_F(CalibrationReaderTest, WindowsLineEndsAreRead) {
  std::string text;
  for (const char c : kSmallCalibration) text += c == '\n' ? std::string("\r\n") : std::string(1, c);
  const Result<CameraCalibration> c = ReadText(text);
  ASSERT_TRUE(c.ok()) << c.status().ToString();
  EXPECT_EQ(c->fx, 40.5);
}

TEST_F(CalibrationReaderTest, HaustraFormatGivesOcamCalib) {
  const Result<CameraCalibration> c = ReadText(kOcam);
  ASSERT_TRUE(c.ok()) << c.status().ToString();
  EXPECT_EQ(c->kind, CameraModelKind::kOcamCalib);
  EXPECT_EQ(c->width_px, 1350);
  EXPECT_EQ(c->cx, 678.5);
  EXPECT_EQ(c->cy, 542.9);
  EXPECT_THAT(c->coefficients, ElementsAre(769.2, -8.1e-4, 6.2e-7, -1.2e-9, 0.9999, 0.0028, -0.0029, 0));
  EXPECT_EQ(c->rate_hz, 29.97);
  EXPECT_EQ(c->max_half_angle_deg, 85.0);
}

TEST_F(CalibrationReaderTest, OpencvFileWithModelIsRead) {
  const Result<CameraCalibration> c = ReadText(kOpencv);
  ASSERT_TRUE(c.ok()) << c.status().ToString();
  EXPECT_EQ(c->kind, CameraModelKind::kKannalaBrandt);
  EXPECT_EQ(c->width_px, 640);
  EXPECT_EQ(c->fy, 501.0);
  EXPECT_EQ(c->cx, 319.5);
  EXPECT_THAT(c->coefficients, ElementsAre(-0.1, 0.02, -0.003, 0.0004, 0, 0, 0, 0));

  const Result<CameraCalibration> pinhole = ReadText(Replaced(kOpencv, "model: fisheye", "fisheye: 0"));
  ASSERT_TRUE(pinhole.ok()) << pinhole.status().ToString();
  EXPECT_EQ(pinhole->kind, CameraModelKind::kPinhole);
}

TEST_F(CalibrationReaderTest, OpencvFileWithoutModelIsNotGuessed) {
  EXPECT_THAT(
      MessageOf(Replaced(kOpencv, "model: fisheye\n", "")),
      AllOf(HasSubstr("calib.yaml:11: 'distortion_coefficients'"), HasSubstr("add a line 'model: pinhole' or")));
}

TEST_F(CalibrationReaderTest, OpencvRationalModelIsRefused) {
  std::string text = Replaced(kOpencv, "model: fisheye", "model: pinhole");
  text = Replaced(text, "rows: 4", "rows: 8");
  text = Replaced(text, "4.0e-04 ]", "4.0e-04, 0., 0., 0.7, 0. ]");
  EXPECT_THAT(MessageOf(text), HasSubstr("'distortion_coefficients' number 7 is not zero"));
}

TEST_F(CalibrationReaderTest, OpencvMatrixOfTheWrongSizeIsRefused) {
  EXPECT_THAT(MessageOf(Replaced(kOpencv, "rows: 4", "rows: 5")), HasSubstr("holds 4 numbers, not 5 x 1"));
  EXPECT_THAT(MessageOf(Replaced(kOpencv, "500., 0., 319.5", "500., 1., 319.5")), HasSubstr("has a skew of 1"));
}

TEST_F(CalibrationReaderTest, KalibrChainsAreRead) {
  const Result<CameraCalibration> c = ReadText(kKalibr);
  ASSERT_TRUE(c.ok()) << c.status().ToString();
  EXPECT_EQ(c->kind, CameraModelKind::kKannalaBrandt);
  EXPECT_EQ(c->height_px, 480);
  EXPECT_EQ(c->fx, 500.0);
  EXPECT_THAT(c->coefficients, ElementsAre(-0.1, 0.02, -0.003, 0.0004, 0, 0, 0, 0));

  const Result<CameraCalibration> radtan = ReadText(Replaced(kKalibr, "equidistant", "radtan"));
  ASSERT_TRUE(radtan.ok()) << radtan.status().ToString();
  EXPECT_EQ(radtan->kind, CameraModelKind::kPinhole);
}

TEST_F(CalibrationReaderTest, KalibrModelsThatAreNotSupportedAreNamed) {
  EXPECT_THAT(MessageOf(Replaced(kKalibr, "camera_model: pinhole", "camera_model: ds")),
              AllOf(HasSubstr("calib.yaml:3: 'cam0.camera_model' is 'ds'"), HasSubstr("pinhole-equi")));
  EXPECT_THAT(MessageOf(Replaced(kKalibr, "equidistant", "fov")), HasSubstr("'cam0.distortion_model' is 'fov'"));
  EXPECT_THAT(MessageOf(std::string(kKalibr) + "cam1:\n  camera_model: pinhole\n"), HasSubstr("holds 2 cameras"));
}

TEST_F(CalibrationReaderTest, EurocSensorFileIsRead) {
  const Result<CameraCalibration> c = ReadText(kEuroc);
  ASSERT_TRUE(c.ok()) << c.status().ToString();
  EXPECT_EQ(c->kind, CameraModelKind::kPinhole);
  EXPECT_EQ(c->width_px, 752);
  EXPECT_EQ(c->rate_hz, 20.0);
  EXPECT_EQ(c->fy, 457.296);
  EXPECT_THAT(c->coefficients, ElementsAre(-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0, 0, 0, 0));
}

TEST_F(CalibrationReaderTest, CalibuRigIsRead) {
  const Result<CameraCalibration> c = ReadText(kCalibu);
  ASSERT_TRUE(c.ok()) << c.status().ToString();
  EXPECT_EQ(c->kind, CameraModelKind::kKannalaBrandt);
  EXPECT_EQ(c->width_px, 1440);
  EXPECT_EQ(c->height_px, 1080);
  EXPECT_EQ(c->fx, 717.2104);
  EXPECT_EQ(c->fy, 717.4816);
  EXPECT_EQ(c->cx, 735.3566);
  EXPECT_EQ(c->cy, 552.7982);
  EXPECT_THAT(c->coefficients, ElementsAre(-0.1389272, -0.001239606, 0.0009125824, -4.071615e-05, 0, 0, 0, 0));
}

TEST_F(CalibrationReaderTest, CalibuOcamCalibRigIsRead) {
  std::string text = Replaced(kCalibu, "calibu_fu_fv_u0_v0_kb4", "ocamcalib_cx_cy_a0_a2_a3_a4_e_f_g");
  const std::size_t begin = text.find("<params>");
  text.replace(begin, text.find("</params>") - begin,
               "<params> [ 700; 500; 769.2; -8.1e-4; 6.2e-7; -1.2e-9; 0.9; 0.1; 0.2 ] ");
  const Result<CameraCalibration> c = ReadText(text);
  ASSERT_TRUE(c.ok()) << c.status().ToString();
  EXPECT_EQ(c->kind, CameraModelKind::kOcamCalib);
  EXPECT_EQ(c->cx, 700.0);
  EXPECT_EQ(c->cy, 500.0);
  EXPECT_THAT(c->coefficients, ElementsAre(769.2, -8.1e-4, 6.2e-7, -1.2e-9, 0.9, 0.1, 0.2, 0));
}

TEST_F(CalibrationReaderTest, CalibuMistakesAreNamed) {
  EXPECT_THAT(MessageOf(Replaced(kCalibu, "_kb4", "_w")), HasSubstr("has type 'calibu_fu_fv_u0_v0_w'"));
  EXPECT_THAT(MessageOf(Replaced(kCalibu, "717.4816;", "")), HasSubstr("<params> holds 7 numbers"));
  EXPECT_THAT(MessageOf(Replaced(kCalibu, "717.4816", "nan")),
              HasSubstr("calib.yaml:11: <params> number 2: 'nan' is not finite"));
  EXPECT_THAT(MessageOf(Replaced(kCalibu, "</rig>", "")), HasSubstr("not valid XML: Start-end tags mismatch"));
  EXPECT_THAT(MessageOf(Replaced(kCalibu, "</pose>", "</poze>")),
              HasSubstr("calib.yaml:15: not valid XML: Start-end tags mismatch"));
  EXPECT_THAT(MessageOf(Replaced(kCalibu, "<width> 1440", "<width> -3")),
              HasSubstr("<width> is not one number of pixels"));
}

TEST_F(CalibrationReaderTest, MisspeltKeyIsNamedWithItsLineAndTheNearest) {
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "Camera.fy", "Camera.fz")),
              HasSubstr("calib.yaml:4: unknown key 'Camera.fz'; did you mean 'Camera.f"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "Camera.width", "Camera.widht")),
              HasSubstr("calib.yaml:11: unknown key 'Camera.widht'; did you mean 'Camera.width'?"));
  EXPECT_THAT(MessageOf(Replaced(kOcam, "  a3:", "  a33:")),
              HasSubstr("calib.yaml:11: unknown key 'coefficients.a33'; did you mean"));
  EXPECT_THAT(MessageOf(Replaced(kOcam, "model:", "modell:")), HasSubstr("did you mean 'model'?"));
  EXPECT_THAT(MessageOf(Replaced(kKalibr, "intrinsics", "intrinsic")), HasSubstr("did you mean 'cam0.intrinsics'?"));
  EXPECT_THAT(MessageOf(Replaced(kOpencv, "image_width", "image_widht")), HasSubstr("did you mean 'image_width'?"));
}

TEST_F(CalibrationReaderTest, KeyOfTheOtherModelIsRefused) {
  EXPECT_THAT(MessageOf(std::string(kSmallCalibration) + "Camera.p1: 0\n"),
              HasSubstr("calib.yaml:15: unknown key 'Camera.p1'"));
  EXPECT_THAT(MessageOf(Replaced(kPinholeSettings, "Camera.p2", "Camera.k4")), HasSubstr("unknown key 'Camera.k4'"));
}

TEST_F(CalibrationReaderTest, MissingKeyIsNamed) {
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "Camera.cx: 31.5\n", "")),
              HasSubstr("calib.yaml: 'Camera.cx' is missing"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "Camera.k3: -0.0031\n", "")), HasSubstr("'Camera.k3' is missing"));
  EXPECT_THAT(MessageOf(Replaced(kOcam, "  c: 0.9999\n", "")), HasSubstr("calib.yaml:8: 'coefficients.c' is missing"));
}

TEST_F(CalibrationReaderTest, NotFiniteValueIsRefusedWithKeyAndLine) {
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "40.5", "nan")),
              HasSubstr("calib.yaml:3: 'Camera.fx': 'nan' is not finite"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "0.008", ".inf")),
              HasSubstr("calib.yaml:8: 'Camera.k2': '.inf' is not finite"));
  EXPECT_THAT(MessageOf(Replaced(kKalibr, "501.0", ".NaN")),
              HasSubstr("calib.yaml:6: 'cam0.intrinsics' number 2: '.NaN' is not finite"));
}

TEST_F(CalibrationReaderTest, ValueThatIsNoNumberIsRefusedWithKeyAndLine) {
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "40.25", "40,25")),
              HasSubstr("calib.yaml:4: 'Camera.fy': '40,25' is not a number"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, " 64", " 64.5")),
              HasSubstr("'Camera.width': '64.5' is not a whole number"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, " 64", "")),
              HasSubstr("calib.yaml:11: 'Camera.width' has no value"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, " 64", " [64]")),
              HasSubstr("'Camera.width' is not a single value"));
}

TEST_F(CalibrationReaderTest, ValueOutOfRangeIsRefusedWithKeyAndLine) {
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "40.5", "-40.5")),
              HasSubstr("calib.yaml:3: 'Camera.fx' is -40.5, not in"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "31.5", "64")),
              HasSubstr("calib.yaml:5: 'Camera.cx' is 64, not in 0 to 63"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, " 48", " 0")),
              HasSubstr("calib.yaml:12: 'Camera.height' is 0, not in 16 to"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, " 25\n", " -1\n")), HasSubstr("'Camera.fps' is -1"));
  // So long from frame to frame that a time stamp cannot hold it.
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, " 25\n", " 1e-10\n")), HasSubstr("'Camera.fps' is 1e-10"));
  EXPECT_THAT(MessageOf(Replaced(kOcam, "769.2", "-769.2")),
              AllOf(HasSubstr("calib.yaml:9: 'coefficients.a0'"), HasSubstr("negate a0 to a4")));
}

// It would move the corners of the picture by more than 10000 times their distance from the centre.
TEST_F(CalibrationReaderTest, DistortionThatNoCameraHasIsRefusedWithKeyAndLine) {
  EXPECT_THAT(
      MessageOf(Replaced(kSmallCalibration, "0.008", "1e9")),
      HasSubstr("calib.yaml:8: 'Camera.k2' is 1e+09, which moves a corner of the picture farther than any lens does"));
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "-0.0031", "-20000")),
              HasSubstr("calib.yaml:9: 'Camera.k3' is -20000"));
  EXPECT_THAT(MessageOf(Replaced(kOpencv, "4.0e-04", "1e9")),
              HasSubstr("calib.yaml:12: 'distortion_coefficients': k4 is 1e+09, which moves"));
  EXPECT_THAT(MessageOf(Replaced(kKalibr, "0.0004", "1e9")),
              HasSubstr("calib.yaml:4: 'cam0.distortion_coeffs': k4 is 1e+09, which moves"));
  EXPECT_THAT(MessageOf(Replaced(kOcam, "  c: 0.9999\n", "  c: 1e9\n")),
              HasSubstr("'coefficients.c' is 1e+09, not in -10"));
  EXPECT_THAT(MessageOf(Replaced(kOcam, "769.2", "1e9")), HasSubstr("'coefficients.a0' is 1e+09, not in 0 to"));
  // A lens of a narrow view: large numbers of what is small at the corner.
  std::string tele = Replaced(kSmallCalibration, "40.5", "4050");
  tele = Replaced(Replaced(tele, "40.25", "4025"), "0.008", "1e5");
  EXPECT_TRUE(ReadText(tele).ok()) << ReadText(tele).status().ToString();
}

// Wider than 180 degrees, its round window small in the middle of a large dark picture.
TEST_F(CalibrationReaderTest, FisheyeInALargeDarkPictureIsRead) {
  const std::string_view padded =
      "cam0:\n"
      "  camera_model: pinhole\n"
      "  distortion_coeffs: [0.00348, 0.00071, -0.00205, 0.0002]\n"
      "  distortion_model: equidistant\n"
      "  intrinsics: [190.98, 190.97, 959.5, 539.5]\n"
      "  resolution: [1920, 1080]\n";
  const Result<CameraCalibration> read = ReadText(padded);
  ASSERT_TRUE(read.ok()) << read.status().ToString();
  EXPECT_EQ(read->coefficients[3], 0.0002);
  EXPECT_THAT(MessageOf(Replaced(padded, "0.0002", "1e9")), HasSubstr("k4 is 1e+09, which moves"));
}

TEST_F(CalibrationReaderTest, KeyThatComesTwiceIsRefused) {
  EXPECT_THAT(MessageOf(std::string(kSmallCalibration) + "Camera.fx: 41\n"),
              HasSubstr("calib.yaml:15: 'Camera.fx' was given before, in line 3"));
}

// What is compared with each other is bounded, whatever a file holds.
TEST_F(CalibrationReaderTest, FileOfVeryManyKeysIsRefused) {
  std::string text(kSmallCalibration);
  for (int i = 0; i < 2000; ++i) text += "k" + std::to_string(i) + ": 1\n";
  EXPECT_THAT(MessageOf(text), HasSubstr("calib.yaml: the file has 2013 keys; a calibration has at most 500"));
}

TEST_F(CalibrationReaderTest, UnknownModelIsRefused) {
  EXPECT_THAT(MessageOf(Replaced(kSmallCalibration, "KannalaBrandt8", "Mei")),
              HasSubstr("calib.yaml:2: 'Camera.type' is 'Mei'; known: KannalaBrandt8, PinHole"));
  EXPECT_THAT(MessageOf(Replaced(kOcam, "ocamcalib", "double_sphere")),
              HasSubstr("known: pinhole, kannala_brandt, ocamcalib"));
}

TEST_F(CalibrationReaderTest, BrokenYamlIsRefusedWithItsLine) {
  EXPECT_THAT(MessageOf("model: pinhole\nintrinsics: {fx: 1, fy: 2\n"), HasSubstr("not valid YAML"));
  EXPECT_THAT(MessageOf("model: pinhole\n\t bad: [1\n"), HasSubstr("calib.yaml:"));
}

TEST_F(CalibrationReaderTest, FileThatIsNoCalibrationIsRefused) {
  EXPECT_THAT(MessageOf(""), HasSubstr("the file is empty"));
  EXPECT_THAT(MessageOf("just text"), HasSubstr("not a map of keys and values"));
  EXPECT_THAT(MessageOf("a: 1\nb: 2\n"), AllOf(HasSubstr("looked for"), HasSubstr("found: a, b")));
  EXPECT_THAT(MessageOf(std::string_view("\x89PNG\0\0", 6)), HasSubstr("a binary file"));
  EXPECT_THAT(MessageOf("<?xml version=\"1.0\"?>\n<opencv_storage>\n</opencv_storage>\n"),
              HasSubstr("OpenCV XML is not supported"));
}

TEST_F(CalibrationReaderTest, MissingFileIsNotFound) {
  EXPECT_EQ(ReadCalibration(folder_.Path("no.yaml")).code(), StatusCode::kNotFound);
}

TEST_F(CalibrationReaderTest, WrittenCalibrationReadsBackTheSame) {
  for (const std::string_view text : {kSmallCalibration, kPinholeSettings, kOcam, kOpencv, kKalibr, kEuroc, kCalibu}) {
    Result<CameraCalibration> original = ReadText(text);
    ASSERT_TRUE(original.ok()) << original.status().ToString();
    original->fx *= 1.0 / 3.0;  // takes all digits
    for (const double max_half_angle_deg : {0.0, 80.1}) {
      original->max_half_angle_deg = max_half_angle_deg;
      original->focal_guess_sigma = max_half_angle_deg / 1000.0;
      const Status written = WriteCalibration(folder_.Path("written.yaml"), *original);
      ASSERT_TRUE(written.ok()) << written.ToString();
      const std::string plain = folder_.Read("written.yaml");
      ASSERT_TRUE(WriteCalibration(folder_.Path("written.yaml"), *original, "A remark: of two words").ok());
      EXPECT_EQ(folder_.Read("written.yaml").find("# A remark: of two words\n"), plain.starts_with("%YAML") ? 10u : 0u);
      const Result<CameraCalibration> read = ReadCalibration(folder_.Path("written.yaml"));
      ASSERT_TRUE(read.ok()) << read.status().ToString();
      EXPECT_EQ(read->kind, original->kind);
      EXPECT_EQ(read->width_px, original->width_px);
      EXPECT_EQ(read->height_px, original->height_px);
      if (original->kind != CameraModelKind::kOcamCalib) {
        EXPECT_EQ(read->fx, original->fx);
        EXPECT_EQ(read->fy, original->fy);
      }
      EXPECT_EQ(read->cx, original->cx);
      EXPECT_EQ(read->cy, original->cy);
      EXPECT_EQ(read->coefficients, original->coefficients);
      EXPECT_EQ(read->rate_hz, original->rate_hz);
      EXPECT_EQ(read->max_half_angle_deg, original->max_half_angle_deg);
      EXPECT_EQ(read->focal_guess_sigma, original->focal_guess_sigma);
    }
  }
}

// In the settings format, which most cameras are written in.
TEST_F(CalibrationReaderTest, AGuessedFocalLengthSaysSoInTheFile) {
  CameraCalibration calibration = ReadText(kSmallCalibration).value();
  calibration.focal_guess_sigma = 0.15;
  ASSERT_TRUE(WriteCalibration(folder_.Path("guess.yaml"), calibration).ok());
  const Result<CameraCalibration> read = ReadCalibration(folder_.Path("guess.yaml"));
  ASSERT_TRUE(read.ok()) << read.status().ToString();
  EXPECT_EQ(read->focal_guess_sigma, 0.15);
  calibration.focal_guess_sigma = 2.0;
  EXPECT_EQ(WriteCalibration(folder_.Path("none.yaml"), calibration).code(), StatusCode::kInvalidArgument);
}

TEST_F(CalibrationReaderTest, CalibrationThatCouldNotBeReadBackIsNotWritten) {
  CameraCalibration calibration = ReadText(kSmallCalibration).value();
  calibration.coefficients[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(WriteCalibration(folder_.Path("nan.yaml"), calibration).code(), StatusCode::kInvalidArgument);
  calibration = ReadText(kSmallCalibration).value();
  EXPECT_EQ(WriteCalibration(folder_.Path("no/folder.yaml"), calibration).code(), StatusCode::kNotFound);
}

}  // namespace
}  // namespace haustra
