// A histogram of durations in fixed memory, log-linear as HdrHistogram's: each power of two is cut into 64 buckets of
// equal width, so that a value read back is at most 1/64 (1.6 %) above the one recorded, from a nanosecond to minutes.
// thread-bound(its owner), rt-safe after construction.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "hal/core/time.h"

namespace haustra {

class LatencyHistogram {
 public:
  LatencyHistogram();

  // Below zero counts as zero, above the largest bucket as that.
  void Add(Duration duration);

  std::uint64_t count() const { return count_; }
  Duration max() const { return max_; }  // exact
  Duration mean() const { return count_ == 0 ? Duration{0} : Duration(sum_ns_ / static_cast<std::int64_t>(count_)); }
  // Nearest rank; the upper edge of its bucket, but never above max(). Zero when empty.
  Duration Quantile(double share) const;

  struct Bucket {
    Duration upper;  // inclusive
    std::uint64_t count = 0;
  };
  // Those that are not empty, smallest first.
  std::vector<Bucket> Buckets() const;

 private:
  std::vector<std::uint64_t> counts_;
  std::uint64_t count_ = 0;
  std::int64_t sum_ns_ = 0;
  Duration max_{0};
};

// The file format: '# haustra latency histogram 1', a comment line a histogram with its figures, then a line a bucket
// that is not empty: name, upper edge in nanoseconds (inclusive), count, share of all values up to there. Separated by
// tabs, in ascending order. A name has no tabs.
std::string HistogramFileHeader();
std::string ToFileText(std::string_view name, const LatencyHistogram& histogram);

}  // namespace haustra
