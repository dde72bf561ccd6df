#include "hal/core/status.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/hal/fatal_trap.h"

namespace haustra {
namespace {

TEST(Status, DefaultIsOk) {
  const Status status;
  EXPECT_TRUE(status.ok());
  EXPECT_EQ(status.code(), StatusCode::kOk);
  EXPECT_EQ(status.ToString(), "ok");
}

TEST(Status, CarriesCodeAndMessage) {
  const Status status = DataLoss("frames/000012.jpg: not a JPEG file");
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(status.code(), StatusCode::kDataLoss);
  EXPECT_EQ(status.ToString(), "data loss: frames/000012.jpg: not a JPEG file");
}

TEST(Status, CodeAloneNeedsNoMessage) {
  EXPECT_EQ(Status(StatusCode::kDeadlineExceeded).ToString(), "deadline exceeded");
}

TEST(Status, EveryCodeHasItsOwnName) {
  std::vector<std::string_view> names;
  for (int code = 0; code <= static_cast<int>(StatusCode::kInternal); ++code) {
    const std::string_view name = ToString(static_cast<StatusCode>(code));
    EXPECT_NE(name, "unknown status");
    for (const std::string_view other : names) EXPECT_NE(name, other);
    names.push_back(name);
  }
}

TEST(Result, HoldsAValue) {
  Result<int> result = 7;
  EXPECT_TRUE(result.ok());
  EXPECT_EQ(*result, 7);
  EXPECT_EQ(result.code(), StatusCode::kOk);
  EXPECT_TRUE(result.status().ok());
}

TEST(Result, HoldsTheReasonWhyThereIsNone) {
  const Result<int> result = NotFound("calib.yaml: no such file");
  EXPECT_FALSE(result.ok());
  EXPECT_EQ(result.code(), StatusCode::kNotFound);
  EXPECT_EQ(result.status().message(), "calib.yaml: no such file");
}

TEST(Result, MovesOutWhatCannotBeCopied) {
  Result<std::unique_ptr<int>> result = std::make_unique<int>(3);
  const std::unique_ptr<int> value = std::move(result).value();
  EXPECT_EQ(*value, 3);
}

TEST(Result, ReadingAMissingValueIsAProgrammerError) {
  const FatalTrap trap;
  const Result<int> result = NotFound("x");
  EXPECT_THROW((void)result.value(), CheckFailure);
}

TEST(Result, OkStatusIsNoReason) {
  const FatalTrap trap;
  EXPECT_THROW((void)Result<int>(Status::Ok()), CheckFailure);
}

Status FailWhen(bool fails) { return fails ? Unavailable("gone") : Status::Ok(); }

Status TryTwice(bool first, bool second, int* steps) {
  HAUSTRA_TRY(FailWhen(first));
  ++*steps;
  HAUSTRA_TRY(FailWhen(second));
  ++*steps;
  return Status::Ok();
}

TEST(StatusMacros, TryReturnsAtTheFirstError) {
  int steps = 0;
  EXPECT_EQ(TryTwice(true, false, &steps).code(), StatusCode::kUnavailable);
  EXPECT_EQ(steps, 0);
  EXPECT_EQ(TryTwice(false, true, &steps).code(), StatusCode::kUnavailable);
  EXPECT_EQ(steps, 1);
  EXPECT_TRUE(TryTwice(false, false, &steps).ok());
  EXPECT_EQ(steps, 3);
}

Result<int> Half(int value) {
  if (value % 2 != 0) return InvalidArgument("odd");
  return value / 2;
}

Result<int> Quarter(int value) {
  HAUSTRA_ASSIGN(const int half, Half(value));
  HAUSTRA_ASSIGN(const int quarter, Half(half));
  return quarter;
}

TEST(StatusMacros, AssignDeclaresTheValueOrReturnsTheStatus) {
  EXPECT_EQ(*Quarter(12), 3);
  EXPECT_EQ(Quarter(6).status().message(), "odd");
}

}  // namespace
}  // namespace haustra
