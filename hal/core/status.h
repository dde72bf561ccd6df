// The only error vocabulary of the project: a code, and for people a message that names the file, line or value.
// rt-safe when the message is empty (a code alone never allocates); thread-safe as a value.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "hal/core/check.h"

namespace haustra {

enum class StatusCode {
  kOk = 0,
  kInvalidArgument,
  kFailedPrecondition,
  kNotFound,
  kCapacityExceeded,
  kDeadlineExceeded,
  kCancelled,
  kUnavailable,
  kDataLoss,
  kInternal,
};

std::string_view ToString(StatusCode code);

class [[nodiscard]] Status {
 public:
  Status() = default;
  explicit Status(StatusCode code) : code_(code) {}
  Status(StatusCode code, std::string message) : code_(code), message_(std::move(message)) {}

  static Status Ok() { return Status(); }

  bool ok() const { return code_ == StatusCode::kOk; }
  StatusCode code() const { return code_; }
  const std::string& message() const { return message_; }
  // "data loss: frames/000012.jpg: not a JPEG file"
  std::string ToString() const;

 private:
  StatusCode code_ = StatusCode::kOk;
  std::string message_;
};

inline Status InvalidArgument(std::string message) { return Status(StatusCode::kInvalidArgument, std::move(message)); }
inline Status FailedPrecondition(std::string message) {
  return Status(StatusCode::kFailedPrecondition, std::move(message));
}
inline Status NotFound(std::string message) { return Status(StatusCode::kNotFound, std::move(message)); }
inline Status CapacityExceeded(std::string message) {
  return Status(StatusCode::kCapacityExceeded, std::move(message));
}
inline Status Unavailable(std::string message) { return Status(StatusCode::kUnavailable, std::move(message)); }
inline Status DataLoss(std::string message) { return Status(StatusCode::kDataLoss, std::move(message)); }
inline Status Internal(std::string message) { return Status(StatusCode::kInternal, std::move(message)); }

// A value or the reason why there is none. Reading the value of a failed result stops the process (programmer error).
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<1>, std::move(value)) {}        // NOLINT: implicit by design
  Result(Status status) : state_(std::in_place_index<0>, std::move(status)) {  // NOLINT: implicit by design
    HAUSTRA_CHECK(!std::get<0>(state_).ok());
  }

  bool ok() const { return state_.index() == 1; }
  Status status() const { return ok() ? Status::Ok() : std::get<0>(state_); }
  StatusCode code() const { return ok() ? StatusCode::kOk : std::get<0>(state_).code(); }

  T& value() & {
    HAUSTRA_CHECK(ok());
    return std::get<1>(state_);
  }
  const T& value() const& {
    HAUSTRA_CHECK(ok());
    return std::get<1>(state_);
  }
  T&& value() && {
    HAUSTRA_CHECK(ok());
    return std::get<1>(std::move(state_));
  }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T&& operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

 private:
  std::variant<Status, T> state_;
};

}  // namespace haustra

// Returns the status to the caller when it is not ok.
#define HAUSTRA_TRY(expression)                                                          \
  do {                                                                                   \
    if (::haustra::Status haustra_try_status = (expression); !haustra_try_status.ok()) { \
      return haustra_try_status;                                                         \
    }                                                                                    \
  } while (false)

#define HAUSTRA_CONCAT_INNER(a, b) a##b
#define HAUSTRA_CONCAT(a, b) HAUSTRA_CONCAT_INNER(a, b)
// HAUSTRA_ASSIGN(auto image, ReadPng(path)); declares `image` or returns the status.
// NOLINTNEXTLINE(bugprone-macro-parentheses): a declaration cannot stand in parentheses.
#define HAUSTRA_ASSIGN_IMPL(result, declaration, expression) \
  auto result = (expression);                                \
  if (!result.ok()) return result.status();                  \
  declaration = std::move(result).value()
#define HAUSTRA_ASSIGN(declaration, expression) \
  HAUSTRA_ASSIGN_IMPL(HAUSTRA_CONCAT(haustra_result_, __LINE__), declaration, expression)
