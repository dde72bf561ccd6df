#include "tools/latency/latency_histogram.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>

namespace haustra {
namespace {

constexpr int kSubBits = 6;       // 64 buckets a power of two
constexpr int kMaxExponent = 40;  // 2^40 ns: 18 minutes
constexpr std::size_t kNumBuckets = static_cast<std::size_t>(kMaxExponent - kSubBits + 1) << kSubBits;

std::size_t BucketOf(std::uint64_t ns) {
  const int exponent = std::max(0, static_cast<int>(std::bit_width(ns)) - 1 - kSubBits);
  // The first 64 values have a bucket each; from there the leading bit is the exponent's.
  const std::uint64_t sub = ns >> exponent;
  const std::size_t bucket = (static_cast<std::size_t>(exponent) << kSubBits) + static_cast<std::size_t>(sub);
  return std::min(bucket, kNumBuckets - 1);
}

std::uint64_t UpperEdge(std::size_t bucket) {
  const std::size_t exponent = bucket < (2u << kSubBits) ? 0 : (bucket >> kSubBits) - 1;
  const std::uint64_t sub = bucket - (exponent << kSubBits);
  return ((sub + 1) << exponent) - 1;
}

}  // namespace

LatencyHistogram::LatencyHistogram() : counts_(kNumBuckets, 0) {}

void LatencyHistogram::Add(Duration duration) {
  const std::int64_t ns = std::max<std::int64_t>(0, duration.count());
  ++counts_[BucketOf(static_cast<std::uint64_t>(ns))];
  ++count_;
  sum_ns_ += ns;
  max_ = std::max(max_, Duration(ns));
}

Duration LatencyHistogram::Quantile(double share) const {
  if (count_ == 0) return Duration{0};
  const auto rank = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(count_)));
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    seen += counts_[i];
    if (seen >= std::clamp<std::uint64_t>(rank, 1, count_)) {
      return std::min(max_, Duration(static_cast<std::int64_t>(UpperEdge(i))));
    }
  }
  return max_;
}

std::vector<LatencyHistogram::Bucket> LatencyHistogram::Buckets() const {
  std::vector<Bucket> buckets;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    if (counts_[i] > 0) buckets.push_back({Duration(static_cast<std::int64_t>(UpperEdge(i))), counts_[i]});
  }
  return buckets;
}

std::string HistogramFileHeader() {
  return "# haustra latency histogram 1\n# name\tupper_ns\tcount\tshare_up_to_here\n";
}

std::string ToFileText(std::string_view name, const LatencyHistogram& histogram) {
  char line[256];
  std::snprintf(line, sizeof(line), "# %.*s: count %llu, mean %.3f ms, p50 %.3f, p99 %.3f, p99.9 %.3f, max %.3f ms\n",
                static_cast<int>(name.size()), name.data(), static_cast<unsigned long long>(histogram.count()),
                ToMilliseconds(histogram.mean()), ToMilliseconds(histogram.Quantile(0.5)),
                ToMilliseconds(histogram.Quantile(0.99)), ToMilliseconds(histogram.Quantile(0.999)),
                ToMilliseconds(histogram.max()));
  std::string text = line;
  std::uint64_t seen = 0;
  for (const LatencyHistogram::Bucket& bucket : histogram.Buckets()) {
    seen += bucket.count;
    std::snprintf(line, sizeof(line), "%.*s\t%lld\t%llu\t%.9f\n", static_cast<int>(name.size()), name.data(),
                  static_cast<long long>(bucket.upper.count()), static_cast<unsigned long long>(bucket.count),
                  static_cast<double>(seen) / static_cast<double>(histogram.count()));
    text += line;
  }
  return text;
}

}  // namespace haustra
