// Geometric inliers between pictures that nobody knows the truth of: what the features of the device are worth on real
// tissue.
//
//   haustra_inlier_benchmark FOLDER... [--distance 1 2 5 10] [--every 10] [--first 0] [--last N] [--focal 0.55]
//                            [--roll 0] [--csv FILE] [--opencv] [--device cpu] [--set KEY=VALUE]
//
// FOLDER: any sequence that `haustra run` takes, or plain pictures (PNG, JPEG) in the order of their names. Every
// --every-th frame is compared with the frames so many later as --distance says: mutual best matches under the
// thresholds of founding (matching.min_similarity, initialisation.brute_force_ratio), and of these the ones that one
// rigid motion explains (pair_judge.h), by the folder's calibration. Where there is none, by that of a nominal fisheye
// whose focal length is --focal of the picture's width (real ones have 0.5 to 0.6): each extractor is judged by the
// same camera, and what it finds too few of is too few for both.
//
// --roll: the later picture of each pair is turned by so many degrees about the camera's axis first, as if the scope
// had been: what orientations are worth.
//
// Prints, by distance, the median, the lowest tenth and the least number of inliers, and means of the rest. --csv has a
// row for each pair. --opencv: OpenCV's SIFT beside it, on the same grey pictures and masks, as many features, with its
// threshold lowered so that it finds as many; same matcher, but without the least similarity, which is made for our
// descriptors. Deterministic.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "capture/open_sequence.h"
#include "engine/camera/camera_model.h"
#include "engine/engine.h"
#include "engine/geometry/constants.h"
#include "platform/assemble.h"
#include "platform/config/engine_config_table.h"
#include "tools/benchmarks/pair_judge.h"
#include "tools/command/number_checks.h"
#include "tools/evaluate/statistics.h"
#include "tools/exit_codes.h"
#ifdef HAUSTRA_HAVE_OPENCV
#include "tools/benchmarks/opencv_sift.h"
#endif

namespace haustra::benchmarks {
namespace {

struct Arguments {
  std::vector<std::string> folders;
  std::vector<int> distances = {1, 2, 5, 10};
  int every = 10;
  std::uint32_t first = 0;
  std::uint32_t last = std::numeric_limits<std::uint32_t>::max();
  double focal_share = 0.55;
  double roll_deg = 0.0;
  std::string csv;
  bool with_opencv = false;
  std::string device = "cpu";
  std::vector<std::string> assignments;
};

// One who finds features.
struct Contestant {
  const char* name;
  double min_similarity;
};

// What one contestant found in one frame.
struct View {
  std::uint32_t frame = 0;
  FrameFeatures features;
};

// Grey, turned about a point, the outside black. The buffer holds it.
ImageView Turn(const ImageView& image, double degrees, double cx, double cy, std::vector<std::uint8_t>* buffer) {
  const int width = image.width, height = image.height;
  std::vector<std::uint8_t> grey(static_cast<std::size_t>(width) * height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::uint8_t* p = image.row(y) + static_cast<std::ptrdiff_t>(x) * BytesPerPixel(image.format);
      grey[static_cast<std::size_t>(y) * width + x] = static_cast<std::uint8_t>(
          image.format == PixelFormat::kBgr8 ? (29 * p[0] + 150 * p[1] + 77 * p[2] + 128) >> 8 : p[0]);
    }
  }
  buffer->assign(grey.size(), 0);
  const double c = std::cos(degrees * kDegree), s = std::sin(degrees * kDegree);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u = cx + c * (x - cx) + s * (y - cy), v = cy - s * (x - cx) + c * (y - cy);
      if (!(u >= 0.0 && v >= 0.0 && u < width - 1 && v < height - 1)) continue;
      const int i = static_cast<int>(u), j = static_cast<int>(v);
      const double fu = u - i, fv = v - j;
      const std::uint8_t* at = grey.data() + static_cast<std::size_t>(j) * width + i;
      (*buffer)[static_cast<std::size_t>(y) * width + x] = static_cast<std::uint8_t>(std::lround(
          (1.0 - fv) * ((1.0 - fu) * at[0] + fu * at[1]) + fv * ((1.0 - fu) * at[width] + fu * at[width + 1])));
    }
  }
  return {buffer->data(), width, height, width, PixelFormat::kGrey8};
}

struct PairRow {
  int distance = 0;
  std::uint32_t frame = 0;
  int num_features = 0;  // of the first
  PairFigures figures;
};

CameraCalibration NominalCamera(int width_px, int height_px, double focal_share) {
  CameraCalibration camera;
  camera.kind = CameraModelKind::kKannalaBrandt;
  camera.width_px = width_px;
  camera.height_px = height_px;
  camera.fx = camera.fy = focal_share * width_px;
  camera.cx = 0.5 * (width_px - 1);
  camera.cy = 0.5 * (height_px - 1);
  camera.rate_hz = 25.0;
  return camera;
}

class FolderBenchmark {
 public:
  FolderBenchmark(std::string folder, const Arguments& arguments, const EngineConfig& config, std::FILE* csv)
      : folder_(std::move(folder)), arguments_(arguments), config_(config), csv_(csv) {}

  Status Run() {
    HAUSTRA_TRY(Open());
    contestants_.push_back({"haustra", config_.matching.min_similarity});
    if (arguments_.with_opencv) contestants_.push_back({"opencv", 0.0});
    rows_.resize(contestants_.size());
    views_.resize(contestants_.size());
    const int longest = *std::max_element(arguments_.distances.begin(), arguments_.distances.end());
    while (true) {
      const Result<Frame> frame = source_->Next(kNoDeadline);
      if (frame.code() == StatusCode::kNotFound) break;
      if (frame.code() == StatusCode::kDataLoss) continue;
      HAUSTRA_TRY(frame.status());
      if (!IsNeeded(frame->index)) continue;
      for (std::size_t who = 0; who < contestants_.size(); ++who) {
        View view{frame->index, FrameFeatures(config_.features.max)};
        HAUSTRA_TRY(Extract(who, frame->image, &view.features));
        if (arguments_.roll_deg == 0.0) {
          for (const int distance : arguments_.distances) HAUSTRA_TRY(Compare(who, view, distance));
        } else {
          View turned{frame->index, FrameFeatures(config_.features.max)};
          const CameraCalibration& camera = camera_.calibration();
          HAUSTRA_TRY(
              Extract(who, Turn(frame->image, arguments_.roll_deg, camera.cx, camera.cy, &turned_), &turned.features));
          for (const int distance : arguments_.distances) HAUSTRA_TRY(Compare(who, turned, distance));
          device_->ReleaseFeatureSet(turned.features.set);
        }
        views_[who].push_back(std::move(view));
        while (views_[who].front().frame + static_cast<std::uint32_t>(longest) <= frame->index) {
          device_->ReleaseFeatureSet(views_[who].front().features.set);
          views_[who].erase(views_[who].begin());
        }
      }
    }
    Print();
    return Status::Ok();
  }

 private:
  Status Open() {
    SequenceOptions options;
    options.first_frame = arguments_.first;
    options.last_frame = arguments_.last;
    Result<std::unique_ptr<FrameSource>> source = OpenSequence(folder_, options);
    CameraCalibration calibration;
    if (source.ok()) {
      calibration = (*source)->calibration();
      camera_text_ = "its calibration";
    } else if (source.code() == StatusCode::kNotFound) {
      options.calibration = NominalCamera(0, 0, 1.0);
      source = OpenSequence(folder_, options);
      HAUSTRA_TRY(source.status());
      const CameraCalibration& size = (*source)->calibration();
      calibration = NominalCamera(size.width_px, size.height_px, arguments_.focal_share);
      camera_text_ = "a nominal camera";
    } else {
      return source.status();
    }
    source_ = std::move(*source);
    HAUSTRA_ASSIGN(camera_, CameraModel::Create(calibration));
    const int longest = *std::max_element(arguments_.distances.begin(), arguments_.distances.end());
    VisionPlan plan;
    plan.max_width_px = calibration.width_px;
    plan.max_height_px = calibration.height_px;
    plan.max_features = plan.max_match_list = config_.features.max;
    plan.max_feature_sets = 2 * (longest + 2);
    HAUSTRA_ASSIGN(device_,
                   CreateVisionDevice(arguments_.device, plan, Engine::ExtractOptionsFor(config_), /*num_threads=*/1));
    HAUSTRA_TRY(device_->SetStaticMask(source_->static_mask()));
    judge_ = std::make_unique<PairJudge>(config_, camera_.width_px(), camera_.height_px(), camera_.focal_px());
    matches_.resize(static_cast<std::size_t>(config_.features.max));
    return Status::Ok();
  }

  bool IsNeeded(std::uint32_t frame) const {
    const auto every = static_cast<std::uint32_t>(arguments_.every);
    return frame % every == 0 ||
           std::any_of(arguments_.distances.begin(), arguments_.distances.end(), [&](int distance) {
             const auto later = static_cast<std::uint32_t>(distance);
             return frame >= later && (frame - later) % every == 0;
           });
  }

  void FindBearings(FrameFeatures* features) const {
    for (int i = 0; i < features->num; ++i) {
      Eigen::Vector3d bearing = Eigen::Vector3d::Zero();  // beyond the model: agrees with nothing
      if (!camera_.Unproject(features->pixel(i), &bearing)) bearing.setZero();
      for (int k = 0; k < 3; ++k) features->bearings[i][k] = static_cast<float>(bearing[k]);
    }
  }

  Status Extract(std::size_t who, const ImageView& image, FrameFeatures* features) {
    return who == 0 ? ExtractOnDevice(image, features) : ExtractWithOpenCv(image, features);
  }

  Status ExtractOnDevice(const ImageView& image, FrameFeatures* features) {
    HAUSTRA_ASSIGN(features->set, device_->CreateFeatureSet());
    ExtractRequest request;
    request.image = image;
    request.set = features->set;
    request.keypoints = features->keypoints;
    request.num_keypoints = &features->num;
    HAUSTRA_TRY(ExtractAndWait(*device_, Lane::kTracking, request));
    FindBearings(features);
    return Status::Ok();
  }

  Status ExtractWithOpenCv([[maybe_unused]] const ImageView& image, [[maybe_unused]] FrameFeatures* features) {
#ifdef HAUSTRA_HAVE_OPENCV
    std::vector<std::uint8_t> descriptors;
    HAUSTRA_TRY(ExtractOpenCvSift(image, source_->static_mask(), config_.features, features, &descriptors));
    HAUSTRA_ASSIGN(features->set, device_->CreateFeatureSet());
    HAUSTRA_TRY(device_->WriteFeatures(
        features->set, std::span(features->keypoints).first(static_cast<std::size_t>(features->num)), descriptors));
    FindBearings(features);
    return Status::Ok();
#else
    return Unavailable("--opencv: this build has no OpenCV (features2d, imgproc)");
#endif
  }

  Status Compare(std::size_t who, const View& later, int distance) {
    const std::uint32_t frame = later.frame - static_cast<std::uint32_t>(distance);
    if (later.frame < static_cast<std::uint32_t>(distance) || frame % static_cast<std::uint32_t>(arguments_.every) != 0)
      return Status::Ok();
    const auto earlier =
        std::find_if(views_[who].begin(), views_[who].end(), [&](const View& view) { return view.frame == frame; });
    if (earlier == views_[who].end()) return Status::Ok();
    std::int32_t num_matches = 0;
    MatchRequest request;
    request.query = DescriptorList::Whole(earlier->features.set);
    request.train = DescriptorList::Whole(later.features.set);
    request.options = {static_cast<float>(contestants_[who].min_similarity),
                       static_cast<float>(config_.initialisation.brute_force_ratio), /*mutual=*/true};
    request.matches = matches_;
    request.num_matches = &num_matches;
    HAUSTRA_TRY(MatchAndWait(*device_, Lane::kTracking, request));
    const auto found = std::span(matches_).first(static_cast<std::size_t>(num_matches));
    rows_[who].push_back(
        {distance, frame, earlier->features.num, judge_->Judge(earlier->features, later.features, found)});
    Write(contestants_[who], rows_[who].back());
    return Status::Ok();
  }

  void Write(const Contestant& who, const PairRow& row) const {
    if (csv_ == nullptr) return;
    const PairFigures& f = row.figures;
    std::fprintf(csv_, "%s,%s,%d,%u,%d,%d,%d,%d,%d,%d,%.2f", folder_.c_str(), who.name, row.distance, row.frame,
                 row.num_features, f.matches, f.inliers, f.places, f.parts, f.still, f.middle_motion_px);
    for (const int inliers : f.inliers_of_octave) std::fprintf(csv_, ",%d", inliers);
    std::fprintf(csv_, "\n");
  }

  void Print() const {
    std::printf("\n%s: %d x %d, by %s\n", folder_.c_str(), camera_.width_px(), camera_.height_px(),
                camera_text_.c_str());
    std::printf(
        "|         | distance | pairs | inliers: median | 10 %% | least | places | parts | matches | features | still "
        "| "
        "by octave -1 | 0 | 1 | 2 | 3 | 4 and on |\n");
    std::printf(
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
    for (std::size_t who = 0; who < contestants_.size(); ++who) {
      for (const int distance : arguments_.distances) {
        std::vector<double> inliers, places, parts;
        double matches = 0.0, features = 0.0, still = 0.0;
        std::array<double, PairFigures::kOctaves> octaves{};
        for (const PairRow& row : rows_[who]) {
          if (row.distance != distance) continue;
          inliers.push_back(row.figures.inliers);
          places.push_back(row.figures.places);
          parts.push_back(row.figures.parts);
          matches += row.figures.matches;
          features += row.num_features;
          still += row.figures.still;
          for (std::size_t i = 0; i < octaves.size(); ++i) octaves[i] += row.figures.inliers_of_octave[i];
        }
        if (inliers.empty()) continue;
        std::sort(inliers.begin(), inliers.end());
        const auto num = static_cast<double>(inliers.size());
        std::printf("| %-7s | %8d | %5zu | %15.1f | %4.0f | %5.0f | %6.1f | %5.1f | %7.1f | %8.1f | %5.1f |",
                    contestants_[who].name, distance, inliers.size(), evaluate::Median(inliers),
                    inliers[inliers.size() / 10], inliers.front(), evaluate::Median(places), evaluate::Median(parts),
                    matches / num, features / num, still / num);
        for (const double octave : octaves) std::printf(" %.1f |", octave / num);
        std::printf("\n");
      }
    }
    std::fflush(stdout);
  }

  std::string folder_;
  const Arguments& arguments_;
  const EngineConfig& config_;
  std::FILE* csv_;
  std::unique_ptr<FrameSource> source_;
  std::string camera_text_;
  CameraModel camera_;
  std::unique_ptr<VisionDevice> device_;
  std::unique_ptr<PairJudge> judge_;
  std::vector<Match> matches_;
  std::vector<std::uint8_t> turned_;
  std::vector<Contestant> contestants_;
  std::vector<std::vector<View>> views_;    // by contestant, oldest first
  std::vector<std::vector<PairRow>> rows_;  // by contestant
};

int Run(const Arguments& arguments) {
  const auto fail = [](const Status& status) {
    std::fprintf(stderr, "haustra_inlier_benchmark: %s\n", status.message().c_str());
    return ExitCodeFor(status.code());
  };
  const Result<ConfigStore<EngineConfig>> config = LoadEngineConfig("", arguments.assignments);
  if (!config.ok()) return fail(config.status());
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> csv(nullptr, &std::fclose);
  if (!arguments.csv.empty()) {
    csv.reset(std::fopen(arguments.csv.c_str(), "w"));
    if (csv == nullptr) return fail(Unavailable(arguments.csv + ": cannot be written"));
    std::fprintf(csv.get(),
                 "folder,extractor,distance,frame,features,matches,inliers,places,parts,still,middle_motion_px,"
                 "octave_-1,octave_0,octave_1,octave_2,octave_3,octave_4_on\n");
  }
  for (const std::string& folder : arguments.folders) {
    const Status status = FolderBenchmark(folder, arguments, config->config(), csv.get()).Run();
    if (!status.ok()) return fail(status);
  }
  return kExitOk;
}

}  // namespace
}  // namespace haustra::benchmarks

int main(int argc, char** argv) {
  haustra::benchmarks::Arguments arguments;
  CLI::App app{"Geometric inliers between pictures without ground truth"};
  app.add_option("folders", arguments.folders, "Sequences or folders of pictures")->required();
  app.add_option("--distance", arguments.distances, "Frames between the two pictures of a pair")
      ->transform(haustra::WholeNumberBetween(1, 1000))
      ->capture_default_str();
  app.add_option("--every", arguments.every, "Every n-th frame is the first of a pair")
      ->transform(haustra::WholeNumberBetween(1, 100000))
      ->capture_default_str();
  app.add_option("--first", arguments.first, "First frame that is read");
  app.add_option("--last", arguments.last, "Last frame that is read");
  app.add_option("--focal", arguments.focal_share, "Of the nominal camera, in widths of the picture")
      ->check(haustra::NumberBetween(0.2, 3.0))
      ->capture_default_str();
  app.add_option("--roll", arguments.roll_deg, "The later picture is turned by so much, degrees")
      ->check(haustra::NumberBetween(-180.0, 180.0))
      ->capture_default_str();
  app.add_option("--csv", arguments.csv, "A row for each pair goes there");
  app.add_flag("--opencv", arguments.with_opencv, "OpenCV's SIFT beside it");
  app.add_option("--device", arguments.device, "cpu or cuda")->capture_default_str();
  app.add_option("--set", arguments.assignments, "Overrides one key of the configuration: section.key=value");
  CLI11_PARSE(app, argc, argv);
  return haustra::benchmarks::Run(arguments);
}
