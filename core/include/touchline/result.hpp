// SPDX-License-Identifier: Apache-2.0
// What the pipeline says after a sample: estimate, contacts, events. Each field of a contact or an
// event is told once, in `visit_fields`: name, meaning in a row of numbers, columns in tables.
// Python's attributes, the columns of contacts.parquet and events.json follow from there.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>

#include "touchline/detail/detector/standing.hpp"
#include "touchline/detail/gates/fault.hpp"
#include "touchline/detail/observer/health.hpp"
#include "touchline/detail/observer/reset_watch.hpp"
#include "touchline/detail/observer/row.hpp"
#include "touchline/detail/place/answer.hpp"
#include "touchline/robot.hpp"

namespace touchline {

// Health bits of the pipeline, besides those of the observer (detail/observer/health.hpp).
constexpr Health kPeriodDiffers = 256;  // stamps are not as far apart as the noise figures are for
constexpr Health kNoRoom = 512;         // more events at a time than there is room for: one was ended
constexpr Health kFaulty = 1024;        // a channel is not believed: `Result::faults`
constexpr Health kOffset = 2048;        // what stands there and is no touch exceeds a threshold
constexpr Health kNoisy = 4096;         // a residual's noise is clearly larger than told

// A view of numbers that belong to someone else.
template <class T>
class Span {
 public:
  Span() = default;
  Span(const T* data, std::size_t size) : data_(data), size_(size) {}
  const T* begin() const { return data_; }
  const T* end() const { return data_ + size_; }
  const T* data() const { return data_; }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  const T& operator[](std::size_t i) const { return data_[i]; }

 private:
  const T* data_ = nullptr;
  std::size_t size_ = 0;
};

// What the observer knows after a sample; NaN where it cannot be computed.
class Estimate {
 public:
  Estimate(const double* row, const RowLayout& layout) : row_(row), layout_(layout) {}

  // (n) external joint torques [Nm], low-passed.
  Span<double> tau_ext() const { return part(layout_.tau_ext(), layout_.joints); }
  // (n) the part of them that contacts on the joint's own segment cause [Nm].
  Span<double> segment_torque() const { return part(layout_.segment_torque(), layout_.joints); }
  // (6) [N, Nm] external wrench on all outboard of sensor s, in its frame, at its origin.
  Span<double> sensor_wrench(int s) const { return part(layout_.sensor_wrench() + 6 * s, 6); }
  // (6) [N, Nm] external wrench on segment g alone, world axes, about the world origin.
  Span<double> segment_wrench(int g) const { return part(layout_.segment_wrench() + 6 * g, 6); }
  bool segment_settled(int g) const { return row_[layout_.segment_settled() + g] > 0.0; }
  // All of it, as `RowLayout` tells.
  Span<double> row() const { return part(0, layout_.width()); }

 private:
  Span<double> part(int begin, int size) const {
    return {row_ + begin, static_cast<std::size_t>(size)};
  }
  const double* row_;
  RowLayout layout_;
};

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr Vec3 kNowhere{kUnknown, kUnknown, kUnknown};

enum class ContactLevel { contact, collision };
enum class Clamped { no, yes, unknown };

// One explanation of a contact or an event; with a radius it stands for a part of a link.
struct PlaceCandidate {
  int link = -1;             // index in `Robot::links`
  double probability = 0.0;  // 0 to 1
  Vec3 position;             // [m] in world
  double radius = 0.0;       // [m]
};

// All explanations, best first.
struct Candidates {
  static constexpr int kMost = Answer::kCandidates;
  int count = 0;
  PlaceCandidate of[kMost];
};

// A contact on one segment at one instant. Unknown are NaN in numbers, -1 in indices and counts.
struct Contact {
  int segment = -1;  // index in `Robot::segment_names`
  int event = -1;    // number of the event that it belongs to
  ContactLevel level = ContactLevel::contact;
  Status status = Status::wrench_only;
  double wrench[6];                   // [N, Nm] on the segment, about the world origin
  int link = -1;                      // index in `Robot::links`, of the one that carries the point
  double body_probability = kUnknown;  // 0 to 1, of the rigid body that the link belongs to
  Vec3 position = kNowhere;           // [m] in world
  Vec3 force = kNowhere;              // [N] on the robot, world axes
  double covariance[9];               // [m2] of the position, row by row
  Candidates candidates;
  bool decided = false;               // is the level more than a default?
  bool searching = false;             // does a search for places still run, that will say more?
  Zone zone = Zone::open;
  Clamped clamped = Clamped::no;      // do forces on two sides oppose each other?
  double rate = kUnknown;             // at which the segment's force grows [N/s]
  int rank = -1, unknowns = -1;       // where no equation is left over: independent ones, unknowns
  double pitch = kUnknown;            // distance of the wrench from that of one force [sigmas]
  double chi2 = kUnknown;             // misfit of the best explanation, with
  int degrees = -1;                   // so many degrees of freedom

  // Square root of the covariance's trace [m].
  double position_std() const {
    const double trace = covariance[0] + covariance[4] + covariance[8];
    return std::sqrt(trace < 0.0 ? 0.0 : trace);
  }
};

// A contact from beginning to end, or so far.
struct Event {
  int id = -1;  // from 0 in the order of detection
  int segment = -1;
  ContactLevel level = ContactLevel::contact;  // how it began, or of a blow while it lasted
  double detected = kUnknown, cleared = kUnknown;  // [s]; the latter while it lasts
  Status status = Status::wrench_only;             // over the event
  int link = -1;
  double body_probability = kUnknown;
  Vec3 position = kNowhere;           // [m] in world at `time_of_position`, from all strong samples
  Vec3 position_link = kNowhere;      // [m] the same in the link's frame
  double time_of_position = kUnknown;  // of the last strong sample that found it there [s]
  double position_std = kUnknown;     // [m]
  Candidates candidates;              // at `time_of_position`
  int joint = -1;                     // the most distal loaded one
  Vec3 force = kNowhere;              // [N] in world, mean over the strong samples
  double force_peak = kUnknown;       // [N]
  double torque_peak = kUnknown;      // [Nm] on `joint`
  double decided = kUnknown;          // when the level was [s]
  Zone zone = Zone::open;
  Clamped clamped = Clamped::no;
  double rate = kUnknown;             // the largest, of the segment's force [N/s]
  int rank = -1, unknowns = -1;
  bool doubted = false;               // may a faulty channel be the cause? No field: `status` tells
};

// What a sample did to an event.
enum class Happened { began, changed, ended };  // changed: its level, decision or clamping
struct EventChange {
  Happened happened;
  Event event;
};

// After one sample. Views stay valid until the pipeline's next call.
struct Result {
  double time;    // [s] of the sample
  Health health;  // bits
  Estimate estimate;
  Span<int> levels;         // `Level` of each segment
  Span<double> normalized;  // per row of the detector: residual less baseline, in thresholds
  Span<double> drift;       // per row: one sigma of what the model's errors may have added [N, Nm]
  Span<double> quiet;       // per segment: over how long its baseline has been averaged [s]
  Span<Watch> watch;        // per segment
  Span<Contact> contacts;   // at least one per segment that is touched
  Span<EventChange> events;
  Span<Fault> faults;       // per channel, as `ChannelLayout`; none where nothing was judged
  Span<char> suspects;      // per channel: does it alone explain what is felt?
  Span<double> ratios;      // per channel: its last step over what is believed at once
  Span<Reset> resets;       // per joint, then per segment: `count` tells when its estimate jumped
};

// --- the fields, each told once ---

// What the numbers of a field mean. Names are indices; flags are `Clamped`; NaN and -1: not known.
enum class FieldKind {
  number, count, flag, vector, segment, joint, link, body, level, status, zone, candidates
};

// `columns`: in contacts.parquet, one name for each number; "-" where it has none.
struct Field {
  const char* name;
  FieldKind kind;
  const char* columns = "";
};

template <class Visit>
void visit_fields(const Contact& c, Visit&& visit) {
  visit(Field{"event", FieldKind::count, "event"}, c.event);
  visit(Field{"segment", FieldKind::segment, "segment"}, c.segment);
  visit(Field{"link", FieldKind::link, "link"}, c.link);
  visit(Field{"body", FieldKind::body, "body"}, c.link);
  visit(Field{"body_probability", FieldKind::number, "body_probability"}, c.body_probability);
  visit(Field{"status", FieldKind::status, "status"}, c.status);
  visit(Field{"position", FieldKind::vector, "x y z"}, c.position);
  visit(Field{"force", FieldKind::vector, "fx fy fz"}, c.force);
  visit(Field{"wrench", FieldKind::vector, "- - - mx my mz"}, c.wrench);
  visit(Field{"position_std", FieldKind::number, "position_std"}, c.position_std());
  visit(Field{"covariance", FieldKind::vector, "pxx pxy pxz - pyy pyz - - pzz"}, c.covariance);
  visit(Field{"level", FieldKind::level}, c.level);
  visit(Field{"decided", FieldKind::flag}, c.decided);
  visit(Field{"searching", FieldKind::flag}, c.searching);
  visit(Field{"zone", FieldKind::zone}, c.zone);
  visit(Field{"clamped", FieldKind::flag}, c.clamped);
  visit(Field{"rate", FieldKind::number}, c.rate);
  visit(Field{"rank", FieldKind::count}, c.rank);
  visit(Field{"unknowns", FieldKind::count}, c.unknowns);
  visit(Field{"pitch", FieldKind::number}, c.pitch);
  visit(Field{"chi2", FieldKind::number}, c.chi2);
  visit(Field{"degrees", FieldKind::count}, c.degrees);
  visit(Field{"candidates", FieldKind::candidates}, c.candidates);
}

template <class Visit>
void visit_fields(const Event& e, Visit&& visit) {
  visit(Field{"id", FieldKind::count}, e.id);
  visit(Field{"segment", FieldKind::segment}, e.segment);
  visit(Field{"level", FieldKind::level}, e.level);
  visit(Field{"detected", FieldKind::number}, e.detected);
  visit(Field{"cleared", FieldKind::number}, e.cleared);
  visit(Field{"status", FieldKind::status}, e.status);
  visit(Field{"link", FieldKind::link}, e.link);
  visit(Field{"body", FieldKind::body}, e.link);
  visit(Field{"body_probability", FieldKind::number}, e.body_probability);
  visit(Field{"position", FieldKind::vector}, e.position);
  visit(Field{"position_link", FieldKind::vector}, e.position_link);
  visit(Field{"time_of_position", FieldKind::number}, e.time_of_position);
  visit(Field{"position_std", FieldKind::number}, e.position_std);
  visit(Field{"joint", FieldKind::joint}, e.joint);
  visit(Field{"force", FieldKind::vector}, e.force);
  visit(Field{"force_peak", FieldKind::number}, e.force_peak);
  visit(Field{"torque_peak", FieldKind::number}, e.torque_peak);
  visit(Field{"decided", FieldKind::number}, e.decided);
  visit(Field{"zone", FieldKind::zone}, e.zone);
  visit(Field{"clamped", FieldKind::flag}, e.clamped);
  visit(Field{"rate", FieldKind::number}, e.rate);
  visit(Field{"rank", FieldKind::count}, e.rank);
  visit(Field{"unknowns", FieldKind::count}, e.unknowns);
  visit(Field{"candidates", FieldKind::candidates}, e.candidates);
}

// The numbers of a value, one after the other.
class FieldNumbers {
 public:
  static constexpr int kOfCandidate = 6;

  explicit FieldNumbers(double* out) : out_(out) {}
  template <class T>
  void operator()(const Field&, const T& value) { put(value); }
  double* end() const { return out_; }

 private:
  void put(double x) { *out_++ = x; }
  void put(int i) { put(static_cast<double>(i)); }
  void put(bool b) { put(b ? 1.0 : 0.0); }
  void put(const Vec3& v) { put(v.x), put(v.y), put(v.z); }
  void put(Clamped c) { put(c == Clamped::unknown ? kUnknown : c == Clamped::yes ? 1.0 : 0.0); }
  void put(ContactLevel level) { put(static_cast<int>(level)); }
  void put(Status status) { put(static_cast<int>(status)); }
  void put(Zone zone) { put(static_cast<int>(zone)); }
  template <std::size_t N>
  void put(const double (&values)[N]) {
    for (const double x : values) put(x);
  }
  void put(const Candidates& candidates) {
    double* const end = out_ + 1 + kOfCandidate * Candidates::kMost;
    put(candidates.count);
    for (int i = 0; i < candidates.count; ++i) {
      const PlaceCandidate& c = candidates.of[i];
      put(c.link), put(c.probability), put(c.position), put(c.radius);
    }
    while (out_ < end) put(kUnknown);
  }

  double* out_;
};

// Writes a contact or an event as numbers; returns where the next one begins.
template <class T>
double* write_numbers(const T& value, double* out) {
  FieldNumbers numbers(out);
  visit_fields(value, numbers);
  return numbers.end();
}

}  // namespace touchline
