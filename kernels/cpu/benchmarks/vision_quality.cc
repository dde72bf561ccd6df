// Matching quality of the device beside that of OpenCV's SIFT: geometric inliers between frames of a sequence. Both
// take the same grey pictures, the same number of features and the same masks.
//
//   haustra_vision_quality SEQUENCE_DIR [step=5] [every=25] [ratio=0.85] [device=cpu]
//
// SEQUENCE_DIR: frames/%06d.jpg, calib.yaml (Kannala-Brandt or pinhole, OpenCV's YAML), mask.png, and optionally
// groundtruth.txt (TUM, world_from_cam) and revisits.csv (pairs of frames that see one place at different times).
// An inlier is a mutual best match that passes the ratio of angles and whose bearings lie within two pixels of the true
// epipolar plane in both images; without ground truth, of the plane of an essential matrix that RANSAC fits to the
// matches (each extractor's own).
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "kernels/cpu/cpu_vision_device.h"
#ifdef HAUSTRA_HAVE_CUDA
#include "kernels/cuda/cuda_vision_device.h"
#endif

namespace haustra {
namespace {

constexpr int kNumFeatures = 2000;
constexpr double kInlierPx = 2.0;

struct Camera {
  bool is_fisheye = true;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, 4> k{};

  cv::Vec3d Bearing(double x, double y) const {
    const double mx = (x - cx) / fx;
    const double my = (y - cy) / fy;
    const double r = std::hypot(mx, my);
    if (r < 1e-12) return {0, 0, 1};
    double theta = std::atan(r);
    if (is_fisheye) {
      theta = r;
      for (int i = 0; i < 20; ++i) {
        const double t2 = theta * theta;
        const double value = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
        const double slope = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])));
        theta -= (value - r) / slope;
      }
    }
    return {std::sin(theta) * mx / r, std::sin(theta) * my / r, std::cos(theta)};
  }
};

struct Pose {
  cv::Matx33d world_from_cam;
  cv::Vec3d centre;
};

bool ReadCamera(const std::string& path, Camera* camera) {
  const cv::FileStorage file(path, cv::FileStorage::READ);
  if (!file.isOpened()) return false;
  camera->is_fisheye = static_cast<std::string>(file["Camera.type"]) == "KannalaBrandt8";
  camera->fx = file["Camera.fx"];
  camera->fy = file["Camera.fy"];
  camera->cx = file["Camera.cx"];
  camera->cy = file["Camera.cy"];
  if (camera->is_fisheye) {
    for (int i = 0; i < 4; ++i) camera->k[i] = file["Camera.k" + std::to_string(i + 1)];
  }
  return true;
}

std::vector<Pose> ReadPoses(const std::string& path) {
  std::vector<Pose> poses;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream in(line);
    double stamp, tx, ty, tz, x, y, z, w;
    if (!(in >> stamp >> tx >> ty >> tz >> x >> y >> z >> w)) continue;
    const double n = std::sqrt(x * x + y * y + z * z + w * w);
    x /= n, y /= n, z /= n, w /= n;
    poses.push_back({{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
                      1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x),
                      1 - 2 * (x * x + y * y)},
                     {tx, ty, tz}});
  }
  return poses;
}

std::vector<std::pair<int, int>> ReadRevisits(const std::string& path) {
  std::vector<std::pair<int, int>> pairs;
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    int a = 0, b = 0;
    if (std::sscanf(line.c_str(), "%d,%d", &a, &b) == 2) pairs.emplace_back(a, b);
  }
  return pairs;
}

struct Features {
  std::vector<cv::Point2f> points;
  cv::Mat descriptors;  // float
};

using Matches = std::vector<std::pair<int, int>>;

// Mutual best matches under the ratio of angles.
Matches MatchFeatures(const Features& a, const Features& b, double ratio) {
  if (a.points.empty() || b.points.empty()) return {};
  cv::Mat unit_a = a.descriptors.clone(), unit_b = b.descriptors.clone();
  for (cv::Mat* m : {&unit_a, &unit_b}) {
    for (int i = 0; i < m->rows; ++i) m->row(i) /= std::max(cv::norm(m->row(i)), 1e-9);
  }
  const cv::Mat products = unit_a * unit_b.t();
  std::vector<int> best_of_b(products.cols, 0);
  for (int j = 0; j < products.cols; ++j) {
    for (int i = 1; i < products.rows; ++i) {
      if (products.at<float>(i, j) > products.at<float>(best_of_b[j], j)) best_of_b[j] = i;
    }
  }
  Matches matches;
  for (int i = 0; i < products.rows; ++i) {
    int best = -1;
    float first = -1, second = -1;
    for (int j = 0; j < products.cols; ++j) {
      const float s = products.at<float>(i, j);
      if (s > first) {
        second = first;
        first = s;
        best = j;
      } else if (s > second) {
        second = s;
      }
    }
    if (best < 0 || best_of_b[best] != i) continue;
    if (std::acos(std::min(first, 1.0f)) > ratio * std::acos(std::clamp(second, 0.0f, 1.0f))) continue;
    matches.emplace_back(i, best);
  }
  return matches;
}

struct Score {
  int matches = 0;
  int inliers = 0;
  int places = 0;   // inliers at different positions
  int covered = 0;  // of 12 x 9 image parts with an inlier
  double median_px = 0;
};

cv::Matx33d TrueEssential(const Pose& a, const Pose& b) {
  const cv::Vec3d t = b.world_from_cam.t() * (a.centre - b.centre);
  return cv::Matx33d(0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0) * (b.world_from_cam.t() * a.world_from_cam);
}

// Zero when there is none.
cv::Matx33d FitEssential(const Features& a, const Features& b, const Camera& camera, const Matches& matches) {
  std::vector<cv::Point2d> rays_a, rays_b;
  for (const auto& [i, j] : matches) {
    const cv::Vec3d ba = camera.Bearing(a.points[i].x, a.points[i].y);
    const cv::Vec3d bb = camera.Bearing(b.points[j].x, b.points[j].y);
    rays_a.emplace_back(ba[0] / ba[2], ba[1] / ba[2]);
    rays_b.emplace_back(bb[0] / bb[2], bb[1] / bb[2]);
  }
  if (matches.size() < 5) return cv::Matx33d::zeros();
  cv::setRNGSeed(1);
  const cv::Mat essential =
      cv::findEssentialMat(rays_a, rays_b, cv::Mat::eye(3, 3, CV_64F), cv::RANSAC, 0.9999, kInlierPx / camera.fx);
  return essential.rows < 3 ? cv::Matx33d::zeros() : cv::Matx33d(essential.rowRange(0, 3));
}

Score Judge(const Features& a, const Features& b, const Camera& camera, const cv::Matx33d& essential,
            const Matches& matches, cv::Size size) {
  Score score;
  std::set<std::pair<int, int>> places, parts;
  std::vector<double> errors;
  for (const auto& [i, j] : matches) {
    ++score.matches;
    const cv::Vec3d ba = camera.Bearing(a.points[i].x, a.points[i].y);
    const cv::Vec3d bb = camera.Bearing(b.points[j].x, b.points[j].y);
    const cv::Vec3d plane_b = essential * ba, plane_a = essential.t() * bb;
    const double error_px = camera.fx * std::max(std::abs(bb.dot(plane_b)) / cv::norm(plane_b),
                                                 std::abs(ba.dot(plane_a)) / cv::norm(plane_a));
    if (!(error_px < kInlierPx)) continue;
    ++score.inliers;
    errors.push_back(error_px);
    places.emplace(std::lround(a.points[i].x), std::lround(a.points[i].y));
    parts.emplace(static_cast<int>(a.points[i].x * 12 / size.width), static_cast<int>(a.points[i].y * 9 / size.height));
  }
  score.places = static_cast<int>(places.size());
  score.covered = static_cast<int>(parts.size());
  if (!errors.empty()) {
    std::nth_element(errors.begin(), errors.begin() + errors.size() / 2, errors.end());
    score.median_px = errors[errors.size() / 2];
  }
  return score;
}

// nullptr, and said so, where there is no such device.
std::unique_ptr<VisionDevice> CreateDevice(const std::string& name, const VisionPlan& plan,
                                           const ExtractOptions& options) {
  if (name == "cpu") return CreateCpuVisionDevice(plan, options, 1).value();
#ifdef HAUSTRA_HAVE_CUDA
  if (name == "cuda") {
    auto device = CreateCudaVisionDevice(plan, options);
    if (device.ok()) return std::move(device).value();
    std::fprintf(stderr, "%s\n", device.status().message().c_str());
    return nullptr;
  }
#endif
  std::fprintf(stderr, "vision device '%s': not in this build\n", name.c_str());
  return nullptr;
}

class Contest {
 public:
  Contest(std::string folder, cv::Mat mask, const std::string& device)
      : folder_(std::move(folder)), mask_(std::move(mask)) {
    VisionPlan plan;
    plan.max_width_px = mask_.cols;
    plan.max_height_px = mask_.rows;
    plan.max_features = kNumFeatures;
    ExtractOptions options;
    options.num_features = kNumFeatures;
    device_ = CreateDevice(device, plan, options);
    if (device_ == nullptr) return;
    const Status status = device_->SetStaticMask(
        {mask_.data, mask_.cols, mask_.rows, static_cast<std::ptrdiff_t>(mask_.step), PixelFormat::kGrey8});
    if (!status.ok()) std::fprintf(stderr, "%s\n", status.message().c_str());
  }

  cv::Mat Read(int frame) const {
    char name[32];
    std::snprintf(name, sizeof(name), "/frames/%06d.jpg", frame);
    return cv::imread(folder_ + name, cv::IMREAD_GRAYSCALE);
  }

  Features Ours(const cv::Mat& grey) {
    Features features;
    const FeatureSetHandle set = device_->CreateFeatureSet().value();
    std::vector<Keypoint> keypoints(kNumFeatures);
    std::int32_t count = 0;
    const Status status =
        ExtractAndWait(*device_, Lane::kTracking,
                       {{grey.data, grey.cols, grey.rows, static_cast<std::ptrdiff_t>(grey.step), PixelFormat::kGrey8},
                        set,
                        keypoints,
                        &count});
    cv::Mat bytes(count, kDescriptorBytes, CV_8U);
    if (!status.ok() || !device_->ReadDescriptors(set, {bytes.data, bytes.total()}).ok()) {
      std::fprintf(stderr, "extraction failed: %s\n", status.message().c_str());
    }
    device_->ReleaseFeatureSet(set);
    bytes.convertTo(features.descriptors, CV_32F);
    for (int i = 0; i < count; ++i) features.points.emplace_back(keypoints[i].x_px, keypoints[i].y_px);
    return features;
  }

  Features Theirs(const cv::Mat& grey) const {
    cv::Mat bright, mask;
    cv::threshold(grey, bright, ExtractOptions{}.reflection_threshold - 1, 255, cv::THRESH_BINARY);
    cv::bitwise_or(bright, 255 - mask_, bright);
    cv::dilate(bright, bright, cv::getStructuringElement(cv::MORPH_RECT, {9, 9}));
    mask = 255 - bright;
    std::vector<cv::KeyPoint> keypoints;
    Features features;
    // Few points in a dim picture: let it have all it can find.
    cv::SIFT::create(kNumFeatures, 3, contrast_)->detectAndCompute(grey, mask, keypoints, features.descriptors);
    for (const cv::KeyPoint& k : keypoints) features.points.push_back(k.pt);
    return features;
  }

  bool has_device() const { return device_ != nullptr; }
  void set_contrast(double contrast) { contrast_ = contrast; }

 private:
  std::string folder_;
  cv::Mat mask_;
  std::unique_ptr<VisionDevice> device_;
  double contrast_ = 0.04;
};

int Run(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: haustra_vision_quality SEQUENCE_DIR [step=5] [every=25] [ratio=0.85] [device=cpu]\n");
    return 64;
  }
  const std::string folder = argv[1];
  const int step = argc > 2 ? std::atoi(argv[2]) : 5;
  const int every = argc > 3 ? std::atoi(argv[3]) : 25;
  const double ratio = argc > 4 ? std::atof(argv[4]) : 0.85;
  Camera camera;
  const cv::Mat mask = cv::imread(folder + "/mask.png", cv::IMREAD_GRAYSCALE);
  const std::vector<Pose> poses = ReadPoses(folder + "/groundtruth.txt");
  std::vector<cv::String> frames;
  cv::glob(folder + "/frames/*.jpg", frames);
  if (!ReadCamera(folder + "/calib.yaml", &camera) || mask.empty() || frames.empty() ||
      (!poses.empty() && poses.size() < frames.size())) {
    std::fprintf(stderr, "%s: needs calib.yaml, mask.png, frames/*.jpg and a pose for each frame or none\n",
                 folder.c_str());
    return 66;
  }
  Contest contest(folder, mask, argc > 5 ? argv[5] : "cpu");
  if (!contest.has_device()) return 69;
  std::vector<std::pair<int, int>> neighbours;
  for (int i = every; i + step < static_cast<int>(frames.size()); i += every) neighbours.emplace_back(i, i + step);
  for (const auto& [name, pairs] :
       {std::pair{"neighbours", neighbours}, std::pair{"revisits", ReadRevisits(folder + "/revisits.csv")}}) {
    Score sums[3];
    int counts[3] = {};
    int ahead = 0;
    for (const auto& [a, b] : pairs) {
      const cv::Mat grey_a = contest.Read(a), grey_b = contest.Read(b);
      if (grey_a.empty() || grey_b.empty()) continue;
      Score scores[3];
      for (int who = 0; who < 3; ++who) {
        contest.set_contrast(who == 1 ? 0.04 : 0.004);
        const Features fa = who == 0 ? contest.Ours(grey_a) : contest.Theirs(grey_a);
        const Features fb = who == 0 ? contest.Ours(grey_b) : contest.Theirs(grey_b);
        const Matches matches = MatchFeatures(fa, fb, ratio);
        const cv::Matx33d essential =
            poses.empty() ? FitEssential(fa, fb, camera, matches) : TrueEssential(poses[a], poses[b]);
        scores[who] = Judge(fa, fb, camera, essential, matches, grey_a.size());
        sums[who].matches += scores[who].matches;
        sums[who].inliers += scores[who].inliers;
        sums[who].places += scores[who].places;
        sums[who].covered += scores[who].covered;
        sums[who].median_px += scores[who].median_px;
        counts[who] += static_cast<int>(fa.points.size());
      }
      ahead += scores[0].inliers >= std::max(scores[1].inliers, scores[2].inliers) ? 1 : 0;
      std::printf("%-10s %4d %4d | inliers haustra %4d opencv %4d opencv-low %4d | places %4d %4d %4d\n", name, a, b,
                  scores[0].inliers, scores[1].inliers, scores[2].inliers, scores[0].places, scores[1].places,
                  scores[2].places);
    }
    if (pairs.empty()) continue;
    const double n = static_cast<double>(pairs.size());
    for (int who = 0; who < 3; ++who) {
      const Score& s = sums[who];
      std::printf(
          "%-10s mean %-10s features %6.1f matches %6.1f inliers %6.1f places %6.1f parts %5.1f median px %.3f\n", name,
          who == 0   ? "haustra"
          : who == 1 ? "opencv"
                     : "opencv-low",
          counts[who] / n, s.matches / n, s.inliers / n, s.places / n, s.covered / n, s.median_px / n);
    }
    std::printf("%-10s haustra ahead of both in %d of %d pairs\n", name, ahead, static_cast<int>(pairs.size()));
  }
  return 0;
}

}  // namespace
}  // namespace haustra

int main(int argc, char** argv) { return haustra::Run(argc, argv); }
