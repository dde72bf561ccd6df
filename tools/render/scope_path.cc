#include "tools/render/scope_path.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <utility>

namespace haustra::render {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kPlanStepS = 0.01;
constexpr double kPlanMarginS = 2.0;
constexpr double kSmoothingS = 0.8;  // of changes of speed
constexpr double kLookAheadMm = 15.0;
constexpr double kPushMm = 1.1;
constexpr double kRegainMmPerS = 5.0;
constexpr double kMinRegainS = 3.0;
constexpr double kMinSlipMm = 20.0, kMaxSlipMm = 45.0;
constexpr double kOutwardsShare = 0.7;  // of the slips
// What a slip leaves to the end of the reach. Longer than the way of the time in which a stop at the end is smoothed.
constexpr double kSlipRoomMm = 12.0;
// Half of the time in which one way through the colon fades into the next.
constexpr double kMaxFadeS = 2.5;
// Places so far apart have nothing in common.
constexpr double kPassShiftMm = 10'000.0;
constexpr double kBaseShutterS = 1.0 / 500.0;
constexpr double kBlurShutterS = 1.0 / 32.0;

double SmoothStep(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * x * (x * (x * 6.0 - 15.0) + 10.0);
}

// 0 at 0 and 1 and outside, 1 in the middle.
double Hump(double x) {
  const double s = std::sin(std::numbers::pi * std::clamp(x, 0.0, 1.0));
  return s * s;
}

double Travel(const std::vector<double>& stops) {
  double sum = 0.0;
  for (std::size_t i = 1; i < stops.size(); ++i) sum += std::abs(stops[i] - stops[i - 1]);
  return sum;
}

int Repeats(const PathStyle& style, double duration_s) {
  const double travel = Travel(style.stops);
  return std::max(1, static_cast<int>(std::ceil(style.speed_mm_per_s * duration_s / (travel * style.max_reach_mm))));
}

std::vector<double> MovingAverage(const std::vector<double>& values, int half) {
  std::vector<double> sums(values.size() + 1, 0.0), out(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) sums[i + 1] = sums[i] + values[i];
  const int count = static_cast<int>(values.size());
  for (int i = 0; i < count; ++i) {
    const int begin = std::max(0, i - half), end = std::min(count, i + half + 1);
    out[i] = (sums[end] - sums[begin]) / (end - begin);
  }
  return out;
}

// Three averages in a row: the second derivative is continuous.
std::vector<double> Smoothed(std::vector<double> values) {
  const int half = static_cast<int>(0.5 * kSmoothingS / kPlanStepS);
  for (int pass = 0; pass < 3; ++pass) values = MovingAverage(values, half);
  return values;
}

}  // namespace

double ScopePath::ReachMm(const PathStyle& style, double duration_s) {
  const int repeats = Repeats(style, duration_s);
  const double num_pauses = repeats * (static_cast<double>(style.stops.size()) - 1.0) - 1.0;
  const double moving_s = std::max(duration_s - num_pauses * style.pause_s, 0.5 * duration_s);
  return style.speed_mm_per_s * moving_s / (repeats * Travel(style.stops));
}

ScopePath::ScopePath(const PathStyle& style, const Centreline& centreline, const std::vector<Event>& events,
                     double duration_s, std::uint64_t seed)
    : ScopePath(style, centreline, events, duration_s, seed, Rng(seed, 0x9a7)) {
  if (style.has_fresh_passes) PlanPasses(seed);
}

ScopePath::ScopePath(const PathStyle& style, const Centreline& centreline, const std::vector<Event>& events,
                     double duration_s, std::uint64_t seed, Rng rng)
    : style_(style),
      centreline_(centreline),
      events_(events),
      duration_s_(duration_s),
      reach_mm_(ReachMm(style, duration_s)),
      offset_x_by_place_(rng, 1.0 / 120.0, 1.0 / 30.0),
      offset_y_by_place_(rng, 1.0 / 120.0, 1.0 / 30.0),
      yaw_by_place_(rng, 1.0 / 110.0, 1.0 / 35.0),
      pitch_by_place_(rng, 1.0 / 110.0, 1.0 / 35.0),
      roll_by_place_(rng, 1.0 / 200.0, 1.0 / 60.0),
      offset_x_(rng, 0.08, 0.7),
      offset_y_(rng, 0.08, 0.7),
      yaw_(rng, 0.07, 1.0),
      pitch_(rng, 0.07, 1.0),
      roll_(rng, 0.08, 0.5),
      push_(rng, 0.3, 1.1) {
  PlanArc(duration_s);
  PlanSlips(seed);
  const double low = LowMm(), high = HighMm();
  for (const Event& event : events) {
    if (!HidesScene(event.kind) || event.kind == EventKind::kSlip) continue;
    double size_mm = 0.0, turn_deg = 0.0;
    switch (event.kind) {
      case EventKind::kJump: size_mm = rng.Uniform(22.0, 30.0), turn_deg = rng.Uniform(16.0, 24.0); break;
      case EventKind::kRedout: size_mm = rng.Uniform(4.0, 9.0), turn_deg = rng.Uniform(6.0, 12.0); break;
      case EventKind::kBlur: size_mm = rng.Uniform(1.0, 3.0), turn_deg = rng.Uniform(2.0, 5.0); break;
      default: size_mm = rng.Uniform(2.0, 6.0), turn_deg = rng.Uniform(3.0, 9.0); break;
    }
    // Scopes are thrown outwards when there is room for it.
    const double arc = PlannedArc(event.start_s + event.duration_s);
    double lost = -size_mm;
    if (arc + lost < low && arc + size_mm < high) lost = size_mm;
    lost = std::clamp(arc + lost, low, high) - arc;
    const double direction = rng.Uniform(0.0, 2.0 * std::numbers::pi);
    const double regain_s = style.regain_s > 0.0 ? style.regain_s : std::max(kMinRegainS, size_mm / kRegainMmPerS);
    jolts_.push_back({event.start_s, event.duration_s, regain_s, lost, event.kind == EventKind::kJump ? 1.6 : 0.0,
                      turn_deg * kDegree * std::cos(direction), turn_deg * kDegree * std::sin(direction)});
  }
  for (Look& look : looks_) {
    const double direction = rng.Uniform(0.0, 2.0 * std::numbers::pi), angle = rng.Uniform(9.0, 15.0) * kDegree;
    look.yaw_rad = angle * std::cos(direction);
    look.pitch_rad = angle * std::sin(direction);
  }
}

void ScopePath::PlanArc(double duration_s) {
  std::vector<double> stops;
  for (int r = 0; r < Repeats(style_, duration_s); ++r) {
    for (std::size_t i = r == 0 ? 0 : 1; i < style_.stops.size(); ++i) stops.push_back(style_.stops[i]);
  }
  const double moving_s = reach_mm_ * Travel(stops) / style_.speed_mm_per_s;
  const double pause_s =
      stops.size() > 2 ? std::max(0.0, duration_s - moving_s) / (static_cast<double>(stops.size()) - 2.0) : 0.0;
  // (time, place) of a plan with sudden turns.
  std::vector<std::pair<double, double>> corners = {{0.0, stops[0]}};
  for (std::size_t i = 1; i < stops.size(); ++i) {
    const double travel_s = reach_mm_ * std::abs(stops[i] - stops[i - 1]) / style_.speed_mm_per_s;
    corners.emplace_back(corners.back().first + travel_s, stops[i]);
    if (i + 1 == stops.size()) break;
    looks_.push_back({corners.back().first + 0.5 * pause_s, 0.0, 0.0});
    corners.emplace_back(corners.back().first + pause_s, stops[i]);
  }
  const int count = static_cast<int>((duration_s + 2.0 * kPlanMarginS) / kPlanStepS) + 2;
  std::size_t leg = 0;
  for (int i = 0; i < count; ++i) {
    const double t = i * kPlanStepS - kPlanMarginS;
    while (leg + 2 < corners.size() && t > corners[leg + 1].first) ++leg;
    const auto& [t0, s0] = corners[leg];
    const auto& [t1, s1] = corners[std::min(leg + 1, corners.size() - 1)];
    const double share = t1 > t0 ? std::clamp((t - t0) / (t1 - t0), 0.0, 1.0) : 1.0;
    planned_arc_mm_.push_back(style_.start_arc_mm + reach_mm_ * (s0 + share * (s1 - s0)));
  }
  planned_arc_mm_ = Smoothed(std::move(planned_arc_mm_));
}

void ScopePath::PlanSlips(std::uint64_t seed) {
  std::vector<Event> events;
  std::copy_if(events_.begin(), events_.end(), std::back_inserter(events),
               [](const Event& event) { return event.kind == EventKind::kSlip; });
  std::stable_sort(events.begin(), events.end(), [](const Event& a, const Event& b) { return a.start_s < b.start_s; });
  Rng rng(seed, 0x9a9);
  for (const Event& event : events) {
    const double size_mm = rng.Uniform(kMinSlipMm, kMaxSlipMm);
    bool is_outwards = rng.Uniform() < kOutwardsShare;
    const double direction = rng.Uniform(0.0, 2.0 * std::numbers::pi), turn = rng.Uniform(8.0, 16.0) * kDegree;
    const double roll = (rng.Uniform() < 0.5 ? -1.0 : 1.0) * rng.Uniform(10.0, 25.0) * kDegree;
    slips_.push_back({event.start_s, event.duration_s, turn * std::cos(direction), turn * std::sin(direction), roll});
    // The other way where there is more room.
    const double arc = PlannedArc(event.start_s + event.duration_s);
    const double out_mm = arc - LowMm() - kSlipRoomMm, in_mm = HighMm() - kSlipRoomMm - arc;
    if ((is_outwards ? out_mm : in_mm) < size_mm) is_outwards = out_mm > in_mm;
    const double slip_mm = std::clamp(is_outwards ? out_mm : in_mm, 0.0, size_mm);
    ShiftPlan(event, is_outwards ? -slip_mm : slip_mm);
  }
}

void ScopePath::ShiftPlan(const Event& event, double arc_mm) {
  const std::size_t count = planned_arc_mm_.size();
  std::vector<double> shift(count), held(count);
  double held_mm = 0.0;  // what the ends of the reach have held back so far
  for (std::size_t i = 0; i < count; ++i) {
    const double t = static_cast<double>(i) * kPlanStepS - kPlanMarginS;
    shift[i] = arc_mm * SmoothStep((t - event.start_s) / event.duration_s);
    const double arc = planned_arc_mm_[i] + shift[i] + held_mm;
    // What was before the slip stays as it was.
    if (t > event.start_s + event.duration_s) held_mm += std::clamp(arc, LowMm(), HighMm()) - arc;
    held[i] = held_mm;
  }
  held = Smoothed(std::move(held));
  for (std::size_t i = 0; i < count; ++i) planned_arc_mm_[i] += shift[i] + held[i];
}

void ScopePath::PlanPasses(std::uint64_t seed) {
  // A turn is in the middle of the pause, where the scope looks around.
  for (const Look& look : looks_) turns_.push_back({look.time_s, kMaxFadeS});
  for (std::size_t i = 1; i < turns_.size(); ++i) {
    const double half_gap_s = 0.5 * (turns_[i].time_s - turns_[i - 1].time_s);
    turns_[i - 1].half_s = std::min(turns_[i - 1].half_s, half_gap_s);
    turns_[i].half_s = std::min(turns_[i].half_s, half_gap_s);
  }
  Rng rng(seed, 0x9a8);
  for (std::size_t i = 0; i <= turns_.size(); ++i)
    pass_roll_deg_.push_back(style_.pass_roll_deg * rng.Uniform(-1.0, 1.0));
}

ScopePath::Pass ScopePath::PassAt(double time_s) const {
  const auto next =
      std::find_if(turns_.begin(), turns_.end(), [&](const Turn& turn) { return time_s < turn.time_s + turn.half_s; });
  const int index = static_cast<int>(next - turns_.begin());
  if (next == turns_.end() || next->half_s <= 0.0) return {index, 0.0};
  return {index, SmoothStep(0.5 * (time_s - next->time_s) / next->half_s + 0.5)};
}

double ScopePath::AtPlace(const Wander& wander, double arc_mm, const Pass& pass) const {
  const double here = wander.At(arc_mm + kPassShiftMm * pass.index);
  if (pass.next_share == 0.0) return here;
  return here + pass.next_share * (wander.At(arc_mm + kPassShiftMm * (pass.index + 1)) - here);
}

double ScopePath::PlannedArc(double time_s) const {
  const double x =
      std::clamp((time_s + kPlanMarginS) / kPlanStepS, 1.0, static_cast<double>(planned_arc_mm_.size()) - 3.0);
  const int i = static_cast<int>(x);
  const double t = x - i;
  // Catmull-Rom.
  const double a = planned_arc_mm_[i - 1], b = planned_arc_mm_[i], c = planned_arc_mm_[i + 1],
               d = planned_arc_mm_[i + 2];
  return b + 0.5 * t * (c - a + t * (2.0 * a - 5.0 * b + 4.0 * c - d + t * (3.0 * (b - c) + d - a)));
}

double ScopePath::Jolt::Share(double time_s) const {
  if (time_s <= start_s + duration_s) return SmoothStep((time_s - start_s) / duration_s);
  return 1.0 - SmoothStep((time_s - start_s - duration_s) / recovery_s);
}

double ScopePath::ArcMm(double time_s) const {
  double arc = PlannedArc(time_s) + kPushMm * push_.At(time_s);
  for (const Jolt& jolt : jolts_) arc += jolt.arc_mm * jolt.Share(time_s);
  return std::clamp(arc, style_.start_arc_mm - 8.0, style_.start_arc_mm + reach_mm_ + 8.0);
}

double ScopePath::ShutterS(double time_s) const {
  double blur = 0.0;
  for (const Event& event : events_) {
    if (event.kind == EventKind::kBlur) blur = std::max(blur, event.Envelope(time_s));
  }
  return kBaseShutterS + blur * (kBlurShutterS - kBaseShutterS);
}

SE3 ScopePath::WorldFromCam(double time_s) const {
  const double arc = ArcMm(time_s);
  const CurveFrame frame = centreline_.At(arc);

  const Pass pass = PassAt(time_s);
  Eigen::Vector2d offset(2.8 * AtPlace(offset_x_by_place_, arc, pass) + 2.3 * offset_x_.At(time_s),
                         2.8 * AtPlace(offset_y_by_place_, arc, pass) + 2.3 * offset_y_.At(time_s));
  // Bounded for good, without a corner: the scope must not meet the wall.
  const double norm = offset.norm();
  if (norm > 1e-9) offset *= style_.max_offset_mm * std::tanh(norm / style_.max_offset_mm) / norm;
  double yaw = kDegree * (style_.gaze_deg * AtPlace(yaw_by_place_, arc, pass) + style_.tremble_deg * yaw_.At(time_s));
  double pitch =
      kDegree * (style_.gaze_deg * AtPlace(pitch_by_place_, arc, pass) + style_.tremble_deg * pitch_.At(time_s));
  double roll = kDegree * (14.0 * AtPlace(roll_by_place_, arc, pass) + 4.0 * roll_.At(time_s));
  if (!pass_roll_deg_.empty()) {
    const double here = pass_roll_deg_[pass.index];
    roll += kDegree * here;
    if (pass.next_share > 0.0) roll += kDegree * pass.next_share * (pass_roll_deg_[pass.index + 1] - here);
  }
  for (const Jolt& jolt : jolts_) {
    const double share = jolt.Share(time_s) + jolt.kick * Hump((time_s - jolt.start_s) / jolt.duration_s);
    yaw += share * jolt.yaw_rad;
    pitch += share * jolt.pitch_rad;
  }
  for (const Slip& slip : slips_) {
    const double share = Hump((time_s - slip.start_s) / slip.duration_s);
    yaw += share * slip.yaw_rad;
    pitch += share * slip.pitch_rad;
    roll += share * slip.roll_rad;
  }
  for (const Look& look : looks_) {
    const double x = (time_s - look.time_s) / 1.1;
    const double bump = std::exp(-x * x);
    yaw += bump * look.yaw_rad;
    pitch += bump * look.pitch_rad;
  }
  for (const Event& event : events_) {
    if (event.kind != EventKind::kBlur) continue;
    const double shake = event.Envelope(time_s) * 2.1 * kDegree;
    yaw += shake * std::sin(2.0 * std::numbers::pi * 5.1 * (time_s - event.start_s));
    pitch += shake * std::sin(2.0 * std::numbers::pi * 4.3 * (time_s - event.start_s) + 1.0);
  }

  // Straight ahead is the lumen a little farther on.
  const CurveFrame ahead = centreline_.At(arc + kLookAheadMm);
  const Eigen::Vector3d forward = (ahead.position - frame.position + 0.3 * kLookAheadMm * frame.tangent).normalized();
  Eigen::Matrix3d axes;
  axes.col(2) = forward;
  axes.col(0) = (frame.normal - frame.normal.dot(forward) * forward).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  const double round = 2.0 * std::numbers::pi * style_.rounds * time_s / duration_s_;
  const Eigen::Quaterniond bend = Eigen::Quaterniond(Eigen::AngleAxisd(round, Eigen::Vector3d::UnitZ())) *
                                  Eigen::AngleAxisd(kDegree * style_.tilt_deg, Eigen::Vector3d::UnitY());
  const Eigen::Quaterniond turn = Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY())) *
                                  Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d outwards = std::cos(round) * axes.col(0) + std::sin(round) * axes.col(1);
  const Eigen::Vector3d position =
      frame.position + offset.x() * frame.normal + offset.y() * frame.binormal - style_.back_off_mm * outwards;
  return SE3(Eigen::Quaterniond(axes) * bend * turn, position);
}

}  // namespace haustra::render
