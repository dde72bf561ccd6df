#include "tools/bench_command/vision_bench.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

#include "capture/codec/image_codec.h"
#include "hal/vision_device.h"
#include "kernels/cpu/cpu_vision_device.h"
#include "tools/bench_command/timing.h"
#include "tools/bench_command/vision_work.h"
#include "tools/command/console.h"
#ifdef HAUSTRA_HAVE_CUDA
#include "kernels/cuda/cuda_memory.h"
#include "kernels/cuda/cuda_vision_device.h"
#endif

namespace haustra {
namespace {

constexpr int kWarmUps = 50;
constexpr int kNumDatabaseQueries = 512;

double NowUs() {
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Time of each call of `task`, which returns a status.
template <typename Task>
Result<Timing> Measure(int repeats, const Task& task) {
  std::vector<double> times;
  times.reserve(repeats);
  for (int i = 0; i < repeats + kWarmUps; ++i) {
    const double before = NowUs();
    HAUSTRA_TRY(task());
    if (i >= kWarmUps) times.push_back(NowUs() - before);
  }
  return Summarise(times);
}

class VisionBench {
 public:
  explicit VisionBench(const VisionBenchOptions& options) : options_(options) {}

  Status Run() {
    HAUSTRA_ASSIGN(image_, ReadImage(options_.image_path, ChannelChoice::kGrey));
    HAUSTRA_TRY(CreateDevice());
    keypoints_.resize(options_.num_features);
    matches_.resize(options_.num_features);
    console::Print("%s: %dx%d on %s, %d features, %d repeats\n", options_.image_path.c_str(), image_.width(),
                   image_.height(), std::string(device_->name()).c_str(), options_.num_features, options_.repeats);
#ifdef HAUSTRA_HAVE_CUDA
    if (cuda_ != nullptr) HAUSTRA_TRY(PrintLimits());
#endif
    HAUSTRA_TRY(BenchExtraction());
    HAUSTRA_TRY(BenchMatching());
#ifdef HAUSTRA_HAVE_CUDA
    if (cuda_ != nullptr) {
      HAUSTRA_TRY(BenchSteps());
      HAUSTRA_TRY(BenchMatchingOnDevice());
      HAUSTRA_TRY(BenchPriorities());
    }
#endif
    return Status::Ok();
  }

 private:
  Status CreateDevice() {
    VisionPlan plan;
    plan.max_width_px = image_.width();
    plan.max_height_px = image_.height();
    plan.max_features = options_.num_features;
    plan.max_feature_sets =
        4 + static_cast<int>((options_.num_database + options_.num_features - 1) / options_.num_features);
    plan.max_match_list = std::max(8192, options_.num_features);
    ExtractOptions extract;
    extract.num_features = options_.num_features;
    if (options_.device == "cpu") {
      HAUSTRA_ASSIGN(device_, CreateCpuVisionDevice(plan, extract, options_.num_threads));
      return Status::Ok();
    }
#ifdef HAUSTRA_HAVE_CUDA
    using kernels::cuda::DotProduct;
    HAUSTRA_ASSIGN(
        auto cuda,
        CreateCudaVisionDevice(plan, extract, {0, options_.use_dp4a ? DotProduct::kDp4a : DotProduct::kTensorCores}));
    cuda_ = cuda.get();
    device_ = std::move(cuda);
    return Status::Ok();
#else
    return Unavailable("vision device 'cuda': this build has no CUDA support; use 'cpu'");
#endif
  }

  Status ExtractOnce(const ImageView& view, Lane lane) {
    HAUSTRA_ASSIGN(const FeatureSetHandle set, device_->CreateFeatureSet());
    const Status status = ExtractAndWait(*device_, lane, {view, set, keypoints_, &count_});
    device_->ReleaseFeatureSet(set);
    return status;
  }

  Status BenchExtraction() {
    HAUSTRA_ASSIGN(const Timing usual,
                   Measure(options_.repeats, [&] { return ExtractOnce(image_.view(), Lane::kTracking); }));
    console::Print("%d features found\n", count_);
    PrintTiming("extraction, picture and keypoints in host memory", usual);
    HAUSTRA_ASSIGN(set_, device_->CreateFeatureSet());
    HAUSTRA_TRY(ExtractAndWait(*device_, Lane::kTracking, {image_.view(), set_, keypoints_, &count_}));
    descriptors_.resize(static_cast<std::size_t>(count_) * kDescriptorBytes);
    HAUSTRA_TRY(device_->ReadDescriptors(set_, descriptors_));
    const ExtractionWork work = CountExtraction(image_.width(), image_.height(), count_);
    console::Print(
        "  counted: %.2f Mpixel a level, %.1f MB of planes written and read once, %.0f million multiply-adds of blur, "
        "%.2f million gradients\n",
        1e-6 * work.plane_pixels, 1e-6 * work.plane_bytes, 1e-6 * work.blur_multiply_adds, 1e-6 * work.patch_samples);
#ifdef HAUSTRA_HAVE_CUDA
    if (cuda_ != nullptr) HAUSTRA_TRY(BenchPinnedExtraction());
#endif
    return Status::Ok();
  }

  Status BenchMatching() {
    const auto match = [&](bool mutual) {
      return MatchAndWait(*device_, Lane::kTracking,
                          {DescriptorList::Whole(set_), DescriptorList::Whole(set_), MatchOptions{0.5f, 0.85f, mutual},
                           nullptr, nullptr, matches_, &count_});
    };
    const int num_features = static_cast<int>(descriptors_.size() / kDescriptorBytes);
    console::Print("matching %d x %d\n", num_features, num_features);
    HAUSTRA_ASSIGN(const Timing one_way, Measure(options_.repeats, [&] { return match(false); }));
    PrintTiming("brute force, launch and wait", one_way);
    HAUSTRA_ASSIGN(const Timing mutual, Measure(options_.repeats, [&] { return match(true); }));
    PrintTiming("brute force, mutual, launch and wait", mutual);
    std::vector<GuidedQuery> queries;
    for (int i = 0; i < num_features; ++i) {
      queries.push_back({{set_, i}, keypoints_[i].x_px, keypoints_[i].y_px, 15.0f, 0.0f, 100.0f});
    }
    HAUSTRA_ASSIGN(const Timing guided, Measure(options_.repeats, [&] {
                     return GuidedMatchAndWait(
                         *device_, Lane::kTracking,
                         {queries, set_, {}, MatchOptions{0.5f, 0.85f, false}, matches_, &count_});
                   }));
    PrintTiming("guided, 15 px, launch and wait", guided);
    return Status::Ok();
  }

#ifdef HAUSTRA_HAVE_CUDA
  Status PrintLimits() {
    HAUSTRA_TRY(cuda_->MeasureLimits(&limits_));
    console::Print(
        "limits measured: empty kernel and wait %.1f us, kernel reads host memory %.1f GB/s, device memory copied %.0f "
        "GB/s, products by mma.sync %.0f TOP/s of halves, %.0f TOP/s of bytes\n",
        limits_.launch_and_wait_us, limits_.host_read_gb_per_s, limits_.copy_gb_per_s, limits_.half_tera_ops_per_s,
        limits_.byte_tera_ops_per_s);
    return Status::Ok();
  }

  Status BenchPinnedExtraction() {
    kernels::cuda::PinnedBlock block;
    const std::size_t pitch = image_.pitch_bytes();
    HAUSTRA_TRY(block.Allocate(pitch * image_.height()));
    auto* const pixels = reinterpret_cast<std::uint8_t*>(block.data());
    for (int y = 0; y < image_.height(); ++y) std::memcpy(pixels + pitch * y, image_.row(y), image_.width());
    const ImageView view = {pixels, image_.width(), image_.height(), image_.pitch_bytes(), PixelFormat::kGrey8};
    HAUSTRA_ASSIGN(const Timing pinned, Measure(options_.repeats, [&] { return ExtractOnce(view, Lane::kTracking); }));
    PrintTiming("extraction, picture in pinned host memory", pinned);
    const ExtractionWork work = CountExtraction(image_.width(), image_.height(), count_);
    console::Print(
        "  of the limits, over the whole time: host link %.1f %%, device memory %.1f %%, half-precision products %.2f "
        "%%\n",
        0.1 * work.picture_bytes / pinned.median_us / limits_.host_read_gb_per_s,
        0.1 * work.plane_bytes / pinned.median_us / limits_.copy_gb_per_s,
        2e-4 * work.blur_multiply_adds / pinned.median_us / limits_.half_tera_ops_per_s);
    HAUSTRA_ASSIGN(const Timing with_descriptors, Measure(options_.repeats, [&]() -> Status {
                     HAUSTRA_ASSIGN(const FeatureSetHandle set, device_->CreateFeatureSet());
                     HAUSTRA_TRY(ExtractAndWait(*device_, Lane::kTracking, {view, set, keypoints_, &count_}));
                     const Status status = device_->ReadDescriptors(set, descriptors_);
                     device_->ReleaseFeatureSet(set);
                     return status;
                   }));
    PrintTiming("the same, descriptors in host memory too", with_descriptors);
    return Status::Ok();
  }

  Status BenchSteps() {
    kernels::cuda::Extractor::StepTime steps[kernels::cuda::Extractor::kNumSteps];
    HAUSTRA_TRY(ExtractOnce(image_.view(), Lane::kTracking));
    HAUSTRA_TRY(cuda_->MeasureExtractionSteps(Lane::kTracking, options_.repeats, steps));
    console::Print(
        "steps of extraction one after the other, between events (about 1.5 us each of which are the event's)\n");
    double sum = 0.0;
    for (const auto& step : steps) {
      console::Print("  %-20s %8.1f us\n", step.name, step.median_us);
      sum += step.median_us;
    }
    console::Print("  %-20s %8.1f us\n", "sum", sum);
    return Status::Ok();
  }

  Status PrintDeviceMatching(std::int64_t num_query, std::int64_t num_train, bool mutual, int repeats) {
    double median_us = 0.0;
    double p99_us = 0.0;
    HAUSTRA_TRY(cuda_->MeasureMatching(num_query, num_train, mutual, repeats, &median_us, &p99_us));
    const MatchingWork work = CountMatching(num_query, num_train);
    const double tera_ops = 2e-6 * work.multiply_adds / median_us;
    const double gb_per_s = 1e-3 * work.bytes / median_us;
    console::Print(
        "brute force on the device, %lld x %lld%s: median %.1f, p99 %.1f us (%.2f); %.1f TOP/s (%.1f %% of the limit), "
        "%.0f GB/s (%.1f %%)\n",
        static_cast<long long>(num_query), static_cast<long long>(num_train), mutual ? ", mutual" : "", median_us,
        p99_us, p99_us / median_us, tera_ops, 100 * tera_ops / limits_.byte_tera_ops_per_s, gb_per_s,
        100 * gb_per_s / limits_.copy_gb_per_s);
    return Status::Ok();
  }

  // Sets filled with the picture's descriptors, each a little changed.
  Status BenchMatchingOnDevice() {
    const int num_features = static_cast<int>(descriptors_.size() / kDescriptorBytes);
    if (num_features == 0) return Status::Ok();
    const std::size_t num_sets =
        2 + static_cast<std::size_t>((options_.num_database + options_.num_features - 1) / options_.num_features);
    std::vector<Keypoint> keypoints(options_.num_features);
    std::vector<std::uint8_t> descriptors(static_cast<std::size_t>(options_.num_features) * kDescriptorBytes);
    std::vector<FeatureSetHandle> sets;
    std::uint32_t random = 12345;
    for (std::size_t s = 0; s < num_sets; ++s) {
      for (std::size_t i = 0; i < descriptors.size(); ++i) {
        random = random * 1664525u + 1013904223u;
        const std::size_t feature = (i / kDescriptorBytes * 7 + s * 31) % num_features;
        const int value = descriptors_[feature * kDescriptorBytes + i % kDescriptorBytes] + (random >> 28) * 2 - 15;
        descriptors[i] = static_cast<std::uint8_t>(std::clamp(value, 0, 255));
      }
      HAUSTRA_ASSIGN(const FeatureSetHandle set, device_->CreateFeatureSet());
      sets.push_back(set);
      HAUSTRA_TRY(device_->WriteFeatures(set, keypoints, descriptors));
    }
    // (The first rows belong to the set of the picture itself.)
    HAUSTRA_TRY(PrintDeviceMatching(options_.num_features, options_.num_features, false, options_.repeats));
    HAUSTRA_TRY(PrintDeviceMatching(options_.num_features, options_.num_features, true, options_.repeats));
    if (options_.num_database > 0) {
      HAUSTRA_TRY(PrintDeviceMatching(kNumDatabaseQueries, options_.num_database, false, 300));
    }
    for (const FeatureSetHandle set : sets) device_->ReleaseFeatureSet(set);
    return Status::Ok();
  }

  // The tracking lane alone, and while the background lane is never idle.
  Status BenchPriorities() {
    std::atomic<bool> stop{false};
    std::atomic<int> num_done{0};
    std::thread background([&] {
      std::vector<Match> matches[8];
      std::int32_t counts[8];
      std::vector<DescriptorRef> refs;
      for (int i = 0; i < 8192; ++i)
        refs.push_back({set_, i % std::max<int>(1, descriptors_.size() / kDescriptorBytes)});
      for (auto& m : matches) m.resize(refs.size());
      while (!stop.load()) {
        Ticket tickets[8];
        for (int k = 0; k < 8; ++k) {
          const auto ticket = device_->EnqueueMatch(
              Lane::kBackground, {DescriptorList::Gather(refs), DescriptorList::Gather(refs),
                                  MatchOptions{0.5f, 0.85f, true}, nullptr, nullptr, matches[k], &counts[k]});
          if (!ticket.ok()) return;
          tickets[k] = *ticket;
        }
        for (int k = 0; k < 8; ++k) {
          if (!device_->Wait(tickets[k], kNoDeadline).ok()) return;
          num_done.fetch_add(1);
        }
      }
    });
    const Result<Timing> loaded =
        Measure(options_.repeats, [&] { return ExtractOnce(image_.view(), Lane::kTracking); });
    stop.store(true);
    background.join();
    HAUSTRA_TRY(loaded.status());
    PrintTiming("extraction while 8192 x 8192 matching fills the other lane", *loaded);
    console::Print("  matchings done meanwhile: %d\n", num_done.load());
    return Status::Ok();
  }

  CudaVisionDevice* cuda_ = nullptr;
  kernels::cuda::DeviceLimits limits_;
#endif

  VisionBenchOptions options_;
  Image image_;
  std::unique_ptr<VisionDevice> device_;
  FeatureSetHandle set_;
  std::vector<Keypoint> keypoints_;
  std::vector<std::uint8_t> descriptors_;
  std::vector<Match> matches_;
  std::int32_t count_ = 0;
};

}  // namespace

Status RunVisionBench(const VisionBenchOptions& options) { return VisionBench(options).Run(); }

}  // namespace haustra
