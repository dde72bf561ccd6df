// What a camera does over time, against pictures of single instants: rows, fields, long exposures.
#include "tools/render/shutter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "tools/render/interlace.h"
#include "tools/render/projected_mesh.h"
#include "tools/render/sequence_model.h"

namespace haustra::render {
namespace {

constexpr double kFastS = 0.5;  // in the middle of a slip

// A small sequence with a slip, and one renderer of it.
struct FilmedScene {
  explicit FilmedScene(const Shutter& shutter) {
    RenderOptions options = RenderOptions::FromPreset(*FindPreset("clear"));
    options.preset.path.start_arc_mm = 14.0;
    options.preset.blind_end_mm = 30.0;
    options.preset.colon.breathing.amplitude = 0.1;
    options.seconds = 1.0;
    options.width_px = 240;
    options.height_px = 180;
    options.num_threads = 2;
    options.events = {{EventKind::kJump, 0.28, 0.44}};
    options.shutter = shutter;
    auto created = SequenceModel::Create(options);
    EXPECT_TRUE(created.ok()) << created.status().message();
    model = std::move(*created);
    renderer = std::make_unique<FrameRenderer>(model->colon(), model->mucosa(), model->camera(), model->window());
  }
  LinearImage At(double time_s) {
    LinearImage light(240, 180);
    model->Expose(time_s, renderer.get(), &light);
    return light;
  }
  std::unique_ptr<SequenceModel> model;
  std::unique_ptr<FrameRenderer> renderer;
};

// Mean difference of rows [begin, end) of two pictures, as a share of the brightness.
double Difference(const LinearImage& a, const LinearImage& b, int begin, int end) {
  double difference = 0.0, sum = 0.0;
  for (int y = begin; y < end; ++y) {
    for (int x = 0; x < a.width; ++x) {
      difference += std::abs(a.pixel(x, y)[1] - b.pixel(x, y)[1]);
      sum += a.pixel(x, y)[1];
    }
  }
  return difference / sum;
}

TEST(Shutter, OutOfRangeIsNamed) {
  EXPECT_TRUE((Shutter{1.0, 1.0, 0.5}).Validate().ok());
  EXPECT_NE((Shutter{1.1, 0.0, 0.0}).Validate().message().find("exposure"), std::string::npos);
  EXPECT_NE((Shutter{0.0, -0.1, 0.0}).Validate().message().find("readout"), std::string::npos);
  EXPECT_NE((Shutter{0.0, 0.0, 0.6}).Validate().message().find("field lag"), std::string::npos);
  EXPECT_FALSE((Shutter{NAN, 0.0, 0.0}).Validate().ok());
}

TEST(RollingShutter, EachVertexIsWhereItsRowSeesIt) {
  const FilmedScene scene({0.0, 1.0, 0.0});
  const SequenceModel& model = *scene.model;
  std::vector<ExposureMoment> rows;
  for (int y = 0; y < 180; ++y) {
    const double t = kFastS + model.RowDelayS(y);
    rows.push_back({t, model.path().ArcMm(t), model.path().WorldFromCam(t), false, {}});
  }
  ProjectedMesh mesh;
  mesh.Project(model.colon(), model.camera(), rows);
  const int begin = model.colon().mesh().FirstRingFrom(rows[90].arc_mm - 45.0);
  int num_checked = 0;
  double farthest_move = 0.0;
  for (int i = 0; i < mesh.num_rings(); ++i) {
    for (int j = 0; j < ProjectedMesh::kM; j += 3) {
      const ProjectedMesh::Vertex& vertex = mesh.vertices[std::size_t(i) * ProjectedMesh::kM + j];
      if (!vertex.in_front || vertex.y_px < 0.0f || vertex.y_px > 178.0f || vertex.x_px < 0.0f ||
          vertex.x_px > 239.0f) {
        continue;
      }
      const auto project = [&](double t) {
        const WallMotion motion =
            model.colon().style().breathing.Motion(model.colon().mesh().ring(begin + i).arc_mm, t);
        Eigen::Vector2d pixel;
        EXPECT_TRUE(model.camera().Project(
            model.path().WorldFromCam(t).Inverse() * model.colon().mesh().Moved(begin + i, j, motion), &pixel));
        return pixel;
      };
      const double delay_s = ((vertex.y_px + 0.5) / 180.0 - 0.5) * 0.04;
      const Eigen::Vector2d seen = project(kFastS + delay_s);
      EXPECT_NEAR(vertex.x_px, seen.x(), 0.03);
      EXPECT_NEAR(vertex.y_px, seen.y(), 0.03);
      farthest_move = std::max(farthest_move, (seen - project(kFastS)).norm());
      ++num_checked;
    }
  }
  EXPECT_GT(num_checked, 2000);
  EXPECT_GT(farthest_move, 2.0);  // or nothing would have been shown
}

TEST(RollingShutter, EachRowIsThatOfAPictureTakenAtItsTime) {
  FilmedScene rolling({0.0, 1.0, 0.0}), global({});
  const LinearImage picture = rolling.At(kFastS), middle = global.At(kFastS);
  for (const int y : {20, 60, 140, 165}) {
    const LinearImage then = global.At(kFastS + rolling.model->RowDelayS(y));
    EXPECT_LT(Difference(then, picture, y, y + 1), 0.02) << y;
    EXPECT_GT(Difference(middle, picture, y, y + 1), 2.0 * Difference(then, picture, y, y + 1)) << y;
  }
  EXPECT_NEAR(rolling.model->RowDelayS(0), -0.02, 2e-4);
  EXPECT_NEAR(rolling.model->RowDelayS(89) + rolling.model->RowDelayS(90), 0.0, 1e-12);
}

TEST(LongExposure, IsTheMeanOfTheInstantsItLasts) {
  FilmedScene open({1.0, 0.0, 0.0}), instant({});
  const LinearImage picture = open.At(kFastS);
  LinearImage mean(240, 180);
  constexpr int kInstants = 40;
  for (int i = 0; i < kInstants; ++i) {
    const LinearImage one = instant.At(kFastS + 0.04 * ((i + 0.5) / kInstants - 0.5));
    for (std::size_t k = 0; k < mean.rgb.size(); ++k) mean.rgb[k] += one.rgb[k] / kInstants;
  }
  EXPECT_LT(Difference(mean, picture, 0, 180), 0.02);
  EXPECT_GT(Difference(mean, instant.At(kFastS), 0, 180), 0.04);
}

TEST(Fields, SecondOneIsLaterByTheLag) {
  const FilmedScene scene({0.0, 0.0, 0.5});
  EXPECT_NEAR(scene.model->SecondFieldS(3), 3 * 0.04 + 0.02, 1e-12);
}

TEST(Fields, AreWovenByRows) {
  Image first(70, 5, PixelFormat::kBgr8), second(70, 5, PixelFormat::kBgr8);
  for (int y = 0; y < 5; ++y) {
    std::fill_n(first.row(y), 210, std::uint8_t{10});
    std::fill_n(second.row(y), 210, std::uint8_t{20});
  }
  WeaveFields(second, &first);
  for (int y = 0; y < 5; ++y) {
    for (const int i : {0, 100, 209}) EXPECT_EQ(int{first.row(y)[i]}, y % 2 == 0 ? 10 : 20);
  }
}

}  // namespace
}  // namespace haustra::render
