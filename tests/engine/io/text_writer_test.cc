#include "engine/io/text_writer.h"

#include <gtest/gtest.h>

#include <clocale>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <random>

namespace haustra {
namespace {

std::string Seconds(std::int64_t nanoseconds) {
  std::string text;
  AppendSeconds(nanoseconds, &text);
  return text;
}

std::string Number(double value) {
  std::string text;
  AppendNumber(value, &text);
  return text;
}

TEST(TextWriter, SecondsKeepEveryNanosecond) {
  EXPECT_EQ(Seconds(0), "0.000000000");
  EXPECT_EQ(Seconds(1), "0.000000001");
  EXPECT_EQ(Seconds(40000000), "0.040000000");
  EXPECT_EQ(Seconds(1700000000123456789), "1700000000.123456789");
  EXPECT_EQ(Seconds(-1500000000), "-1.500000000");
  EXPECT_EQ(Seconds(std::numeric_limits<std::int64_t>::min()), "-9223372036.854775808");
}

TEST(TextWriter, NumbersReadBackToTheSameValue) {
  std::mt19937_64 rng(5);
  std::uniform_real_distribution<double> mantissa(-1.0, 1.0);
  std::uniform_int_distribution<int> exponent(-60, 60);
  for (int i = 0; i < 10000; ++i) {
    const double value = std::ldexp(mantissa(rng), exponent(rng));
    EXPECT_EQ(std::strtod(Number(value).c_str(), nullptr), value);
  }
}

TEST(TextWriter, NumbersAreAsShortAsCanBe) {
  EXPECT_EQ(Number(0.1), "0.1");
  EXPECT_EQ(Number(398.2), "398.2");
  EXPECT_EQ(Number(-0.0), "0");
  std::string text;
  AppendNumber(0.1f, &text);
  EXPECT_EQ(text, "0.1");
}

TEST(TextWriter, LocaleWithDecimalCommaChangesNothing) {
  if (std::setlocale(LC_ALL, "de_DE.UTF-8") == nullptr) GTEST_SKIP() << "this machine has no such locale";
  EXPECT_EQ(Number(1.5), "1.5");
  std::setlocale(LC_ALL, "C");
}

TEST(TextWriter, LongTextArrivesWholeAndInOrder) {
  StringSink sink;
  TextWriter writer(sink);
  std::string expected;
  for (int i = 0; i < 50000; ++i) {
    writer.Integer(i).Text("\n");
    expected += std::to_string(i) + "\n";
  }
  ASSERT_TRUE(writer.Finish().ok());
  EXPECT_EQ(sink.bytes(), expected);
}

class FullSink final : public ByteSink {
 public:
  explicit FullSink(std::size_t capacity) : capacity_(capacity) {}
  Status Write(std::string_view bytes) override {
    ++num_calls_;
    if (bytes.size() > capacity_) return Unavailable("disk full");
    capacity_ -= bytes.size();
    return Status::Ok();
  }
  int num_calls() const { return num_calls_; }

 private:
  std::size_t capacity_;
  int num_calls_ = 0;
};

TEST(TextWriter, ErrorOfTheSinkIsReturnedAndEndsTheWriting) {
  FullSink sink(100000);
  TextWriter writer(sink);
  for (int i = 0; i < 100000; ++i) writer.Text("ten bytes\n");
  EXPECT_EQ(writer.Finish().message(), "disk full");
  EXPECT_EQ(sink.num_calls(), 2);
}

}  // namespace
}  // namespace haustra
