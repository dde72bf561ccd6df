// The numbers of a lane's requests, and which of the last of them were dropped. thread-bound(the lane's), rt-safe.
#pragma once

#include <cstdint>
#include <string>

#include "hal/vision_device.h"

namespace haustra::kernels {

class LaneRequests {
 public:
  static constexpr std::uint64_t kNumLanes = static_cast<std::uint64_t>(Lane::kNumLanes);

  static Ticket TicketOf(Lane lane, std::uint64_t number) {
    return Ticket{number * kNumLanes + static_cast<std::uint64_t>(lane)};
  }
  static std::uint64_t NumberOf(Ticket ticket) { return ticket.value / kNumLanes; }
  static int LaneIndexOf(Ticket ticket) { return static_cast<int>(ticket.value % kNumLanes); }

  // Of the newest request; 0: there was none.
  std::uint64_t last() const { return last_; }
  std::uint64_t Next() {
    dropped_ <<= 1;
    return ++last_;
  }
  void Drop(std::uint64_t number) {
    if (IsKnown(number)) dropped_ |= std::uint64_t{1} << (last_ - number);
  }

  // What a wait for the ticket says before it looks at the work. kInvalidArgument: never given out, or known no more.
  // kFailedPrecondition: dropped; without words, which would allocate.
  Status Check(Ticket ticket) const {
    const std::uint64_t number = NumberOf(ticket);
    if (!IsKnown(number)) {
      return InvalidArgument("ticket " + std::to_string(ticket.value) + " was never given out, or is " +
                             std::to_string(kKnownTickets) + " requests old");
    }
    const bool is_dropped = (dropped_ >> (last_ - number) & 1) != 0;
    return is_dropped ? Status(StatusCode::kFailedPrecondition) : Status::Ok();
  }

 private:
  static_assert(kKnownTickets == 64, "a bit for each");

  bool IsKnown(std::uint64_t number) const {
    return number != 0 && number <= last_ && last_ - number < std::uint64_t{kKnownTickets};
  }

  std::uint64_t last_ = 0;
  std::uint64_t dropped_ = 0;  // bit i: of the request i before the last
};

}  // namespace haustra::kernels
