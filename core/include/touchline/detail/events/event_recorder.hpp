// SPDX-License-Identifier: Apache-2.0
// From contacts, sample by sample, to events. As many events may last at a time as a segment can
// have contacts; where there is no room for one more, the oldest on that segment is ended. No
// allocation per sample.
// Theory: docs/theory.md, section 7.3.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/events/describe.hpp"
#include "touchline/detail/localizer/localizer.hpp"
#include "touchline/result.hpp"

namespace touchline {

// What an event has brought so far.
struct LastingEvent {
  int id = -1, serial = -1;  // numbers of the event, and of the localizer's contact
  int segment = -1;
  bool lasts = false, began = false, changed = false;
  double detected = 0.0;
  ContactLevel level = ContactLevel::contact;
  double decided = kUnknown, rate = kUnknown;
  bool clamped = false;
  double strength = 0.0;       // the largest so far
  double force = 0.0;          // the largest [N], and the wrench and the joint positions then
  double wrench[6] = {};       // [N, Nm]
  std::vector<double> q;       // (n)
  std::vector<double> torque;  // (n) the largest of each joint [Nm]
  std::vector<double> sum;     // of normalized rows and force, over samples near the peak
  // Samples of it, those whose wrench is known, and those that may be no contact's.
  int count = 0, wrenches = 0, doubted = 0;
  bool apart = false;  // was there an answer with a rank? It is the last one:
  Status undetermined_status = Status::none;
  int rank = -1, unknowns = -1;
  Candidates candidates;
};

class EventRecorder {
 public:
  // Robot, observer and localizer stay the caller's.
  EventRecorder(const Robot& robot, const Observer& observer, Localizer& localizer)
      : strong_share_(localizer.settings().strong_share),
        robot_(robot),
        observer_(observer),
        localizer_(localizer),
        state_(observer.tree().make_state<double>()),
        rest_(robot.joints.size(), 0.0),
        limits_(robot.joints.size(), kUnknown),
        mean_(robot.rows.size() + 3) {
    const std::size_t most = Reports::kMost + 1;
    events_.resize(robot.segment_names.size() * most);
    for (LastingEvent& e : events_) {
      e.q.resize(rest_.size());
      e.torque.resize(rest_.size());
      e.sum.resize(mean_.size());
    }
    changes_.reserve(3 * events_.size());  // each ends, another begins in its place and changes
    scratch_.q = localizer.memories(0).front().q;
    scratch_.links = localizer.memories(0).front().links;
    for (const DetectionRow& row : robot.rows) {
      if (row.joint >= 0) limits_[row.joint] = row.contact;
    }
  }

  // A sample begins.
  void begin() {
    changes_.clear();
    crowded_ = false;
  }

  // Takes what is said of a contact; returns the number of its event. `doubted`: one faulty channel, or
  // an error of the model, may be the cause of this sample; `since_begun`: a channel of all so far.
  int add(int serial, const Contact& c, bool doubted, bool since_begun, double share, double time,
          const double* q, const Span<double>& tau_ext, const Span<double>& normalized) {
    LastingEvent& e = lasting(serial, c.segment, time);
    double wrench[6];
    std::copy_n(c.wrench, 6, wrench);
    if (share < 1.0) wrench[0] = c.force.x, wrench[1] = c.force.y, wrench[2] = c.force.z;
    add_peaks(e, wrench, q, tau_ext);
    if (add_rows(e, share, wrench, normalized) && doubted) ++e.doubted;
    if (since_begun) e.doubted = e.count;
    if (c.unknowns > 0) {
      e.apart = true;
      e.undetermined_status = c.status;
      e.rank = c.rank;
      e.unknowns = c.unknowns;
      if (c.status == Status::not_separable) e.candidates = c.candidates;
    }
    classify(e, c, time);
    return e.id;
  }

  // The event of a contact; null: it begins now.
  const LastingEvent* of(int serial) const {
    for (const LastingEvent& e : events_) {
      if (e.lasts && e.serial == serial) return &e;
    }
    return nullptr;
  }

  // One faulty channel may be the cause of all of the event of a contact.
  void doubt_all_of(int serial) {
    for (LastingEvent& e : events_) {
      if (e.lasts && e.serial == serial) e.doubted = e.count;
    }
  }

  // The event of a contact ends.
  void end(Localizer::Memory& memory, double time) {
    for (LastingEvent& e : events_) {
      if (e.lasts && e.serial == memory.serial) close(e, time);
    }
  }

  // All contacts of the sample have been taken: tells what became of the events that last.
  void finish() {
    for (LastingEvent& e : events_) {
      if (e.lasts && (e.began || e.changed))
        note(e, e.began ? Happened::began : Happened::changed);
      e.began = e.changed = false;
    }
  }

  // What the last sample did to events. And was there no room for one?
  const std::vector<EventChange>& changes() const { return changes_; }
  bool crowded() const { return crowded_; }
  int next_event() const { return next_; }
  void number_events_from(int next) { next_ = next; }

  // Calls `visit(Event)` for each event that lasts, in the order of detection.
  template <class Visit>
  void visit_lasting(Visit&& visit) {
    int last = -1;
    while (true) {
      const LastingEvent* next = nullptr;
      for (const LastingEvent& e : events_) {
        if (e.lasts && e.id > last && (next == nullptr || e.id < next->id)) next = &e;
      }
      if (next == nullptr) return;
      last = next->id;
      describe(*next, described_);
      visit(static_cast<const Event&>(described_));
    }
  }

 private:
  LastingEvent& lasting(int serial, int segment, double time) {
    LastingEvent *room = nullptr, *oldest = nullptr;
    for (LastingEvent& e : events_) {
      if (e.lasts && e.serial == serial) return e;
      if (!e.lasts && room == nullptr) room = &e;
      if (e.lasts && e.segment == segment && (oldest == nullptr || e.id < oldest->id)) oldest = &e;
    }
    if (room == nullptr) {
      crowded_ = true;
      room = oldest != nullptr ? oldest : &events_.front();
      close(*room, time);
    }
    open(*room, serial, segment, time);
    return *room;
  }

  void open(LastingEvent& e, int serial, int segment, double time) {
    e.id = next_++;
    e.serial = serial;
    e.segment = segment;
    e.lasts = e.began = true;
    e.changed = e.clamped = e.apart = false;
    e.detected = time;
    e.level = ContactLevel::contact;
    e.decided = e.rate = kUnknown;
    e.strength = e.force = 0.0;
    e.count = e.wrenches = e.doubted = 0;
    std::fill_n(e.wrench, 6, 0.0);
    for (std::vector<double>* values : {&e.q, &e.torque, &e.sum})
      std::fill(values->begin(), values->end(), 0.0);
    e.rank = e.unknowns = -1;
    e.candidates.count = 0;
  }

  void close(LastingEvent& e, double time) {
    note(e, Happened::ended);
    changes_.back().event.cleared = time;
    e.lasts = e.began = e.changed = false;
  }

  void note(const LastingEvent& e, Happened happened) {
    changes_.emplace_back();
    changes_.back().happened = happened;
    describe(e, changes_.back().event);
  }

  static double known(double x) { return std::isnan(x) ? 0.0 : x; }

  void add_peaks(LastingEvent& e, const double* wrench, const double* q,
                 const Span<double>& tau_ext) const {
    const double force = norm(Vec3{known(wrench[0]), known(wrench[1]), known(wrench[2])});
    if (force > e.force) {
      e.force = force;
      std::copy_n(wrench, 6, e.wrench);
      std::copy_n(q, e.q.size(), e.q.begin());
    }
    for (std::size_t j = 0; j < e.torque.size(); ++j)
      e.torque[j] = std::max(e.torque[j], std::fabs(known(tau_ext[j])));
  }

  // For the mean over the samples that come near the peak of those up to then; is it one?
  bool add_rows(LastingEvent& e, double share, const double* wrench,
                const Span<double>& normalized) const {
    double largest = 0.0;
    for (std::size_t i = 0; i < robot_.rows.size(); ++i) {
      if (robot_.rows[i].segment == e.segment) largest = std::max(largest, std::fabs(normalized[i]));
    }
    const double strength = share * largest;
    if (strong_share_ * strength > e.strength) {  // all that came before was weak
      std::fill(e.sum.begin(), e.sum.end(), 0.0);
      e.count = e.wrenches = e.doubted = 0;
    }
    e.strength = std::max(e.strength, strength);
    if (strength < strong_share_ * e.strength) return false;
    const std::size_t rows = normalized.size();
    for (std::size_t i = 0; i < rows; ++i) e.sum[i] += normalized[i];
    for (std::size_t i = 0; i < 3; ++i) e.sum[rows + i] += known(wrench[i]);
    if (wrench[0] == wrench[0]) ++e.wrenches;
    ++e.count;
    return true;
  }

  static void classify(LastingEvent& e, const Contact& c, double time) {
    if (c.decided && std::isnan(e.decided)) {
      e.decided = time;
      e.changed = true;
    }
    if (c.level == ContactLevel::collision && e.level != ContactLevel::collision) {
      e.level = ContactLevel::collision;
      e.decided = time;
      e.changed = true;
    }
    if (c.clamped == Clamped::yes && !e.clamped) e.clamped = e.changed = true;
    if (std::isfinite(c.rate)) e.rate = std::fmax(std::isnan(e.rate) ? 0.0 : e.rate, c.rate);
  }

  // All that is known of an event.
  void describe(const LastingEvent& e, Event& out) {
    out = Event{};
    out.id = e.id;
    out.segment = e.segment;
    out.level = e.level;
    out.detected = e.detected;
    out.decided = e.decided;
    out.rate = e.rate;
    const double samples = std::max(e.count, 1);
    for (std::size_t i = 0; i < mean_.size(); ++i) mean_[i] = e.sum[i] / samples;
    const int sensor = observer_.layout().segments[e.segment].sensor;
    if (sensor >= 0 && e.wrenches > 0) {  // while the sensor is lost a force is not known
      const double* force = e.sum.data() + robot_.rows.size();
      const double of = e.wrenches;
      out.force = {force[0] / of, force[1] / of, force[2] / of};
      out.force_peak = e.force;
    }
    out.joint = loaded_joint(e, sensor);
    if (out.joint >= 0 && e.torque[out.joint] > 0.0) out.torque_peak = e.torque[out.joint];
    place(e, out);
    if (e.apart && out.status == e.undetermined_status) {
      out.rank = e.rank;
      out.unknowns = e.unknowns;
      if (out.status == Status::not_separable) out.candidates = e.candidates;
    }
    if (2 * e.doubted > e.count) doubt(out);
    out.zone = out.link >= 0 ? robot_.links[out.link].zone : robot_.segment_zones[e.segment];
    out.clamped = e.clamped                                ? Clamped::yes
                  : out.status == Status::not_separable ? Clamped::unknown
                                                           : Clamped::no;
  }

  // Where it is, from all its strong samples.
  void place(const LastingEvent& e, Event& out) {
    const Localizer::Memory* memory = nullptr;
    for (const Localizer::Memory& m : localizer_.memories(e.segment)) {
      if (m.serial == e.serial) memory = &m;
    }
    if (memory == nullptr) return;
    scratch_.event = memory->event;  // weighing sorts the places: the localizer's stay as they are
    scratch_.undetermined = memory->undetermined;
    scratch_.links = memory->links;
    scratch_.revision = memory->revision;
    std::copy(memory->q.begin(), memory->q.end(), scratch_.q.begin());
    localizer_.conclude(scratch_);
    const Status status = localizer_.status(scratch_);
    out.status = status == Status::none ? Status::wrench_only : status;
    const int count = std::min(scratch_.event.count(), Candidates::kMost);
    if (count == 0) return;
    observer_.tree().sweep(localizer_.positions(scratch_), rest_.data(), state_);
    Vec3 best;  // in the frame of the node
    for (int i = 0; i < count; ++i) {
      const Place& p = scratch_.event.place(i);
      const LinkSurface& surface = localizer_.surfaces()[p.surface];
      const Vec3 point = surface.mesh.nearest_to_point(p.point).point;
      const NodeState<double>& X = state_.node(surface.node);
      out.candidates.of[i] = {p.surface, p.share, plain(X.R * point + X.p), 0.0};
      if (i == 0) best = point;
    }
    out.candidates.count = count;
    if (out.status != Status::located && out.status != Status::ambiguous) return;
    const PlaceCandidate& first = out.candidates.of[0];
    out.link = first.link;
    out.position = first.position;
    const Pose& placement = robot_.links[first.link].placement;
    out.position_link = transposed_times(placement.R, best - placement.p);
    out.time_of_position = scratch_.event.time();
    out.position_std = std::sqrt(scratch_.event.variance());
    out.body_probability = 0.0;
    for (int i = 0; i < count; ++i) {
      if (node(out.candidates.of[i].link) == node(first.link))
        out.body_probability += out.candidates.of[i].probability;
    }
  }

  int node(int link) const { return localizer_.surfaces()[link].node; }

  // The most distal joint that the event loads; -1 where no torque tells.
  int loaded_joint(const LastingEvent& e, int sensor) {
    int deepest = -1, most = -1;
    for (std::size_t i = 0; i < robot_.rows.size(); ++i) {
      const DetectionRow& row = robot_.rows[i];
      if (row.segment != e.segment || row.joint < 0) continue;
      if (std::fabs(mean_[i]) > 1.0 && (deepest < 0 || depth(row.joint) > depth(deepest)))
        deepest = row.joint;
      if (most < 0 || std::fabs(mean_[i]) > std::fabs(mean_[most])) most = static_cast<int>(i);
    }
    if (deepest >= 0) return deepest;
    if (sensor >= 0) return inboard_joint(e, sensor);
    return most < 0 ? -1 : robot_.rows[most].joint;
  }

  // How many nodes lie between the world and a joint.
  int depth(int joint) const {
    int nodes = 0;
    for (int i = robot_.joints[joint].nodes.front(); i >= 0; i = robot_.nodes[i].parent) ++nodes;
    return nodes;
  }

  // The most distal joint inboard of a segment that its wrench loads beyond its threshold.
  int inboard_joint(const LastingEvent& e, int sensor) {
    observer_.tree().sweep(e.q.data(), rest_.data(), state_);
    const Vec3 force{e.wrench[0], e.wrench[1], e.wrench[2]};
    const Vec3 moment{e.wrench[3], e.wrench[4], e.wrench[5]};
    for (int i = robot_.sensors[sensor].node; i >= 0; i = robot_.nodes[i].parent) {
      const Node& node = robot_.nodes[i];
      if (node.coordinate < 0 || std::isnan(limits_[node.coordinate])) continue;
      const NodeState<double>& X = state_.node(i);
      const Vec3 load = node.kind == NodeKind::prismatic ? force : moment - cross(plain(X.p), force);
      if (std::fabs(node.multiplier * dot(plain(X.R.z), load)) > limits_[node.coordinate])
        return node.coordinate;
    }
    return -1;
  }

  double strong_share_;
  const Robot& robot_;
  const Observer& observer_;
  Localizer& localizer_;
  TreeState<double> state_;
  std::vector<double> rest_;    // velocities of an arm at rest
  std::vector<double> limits_;  // contact thresholds of the joints [Nm]; NaN: not tested
  std::vector<double> mean_;
  std::vector<LastingEvent> events_;
  std::vector<EventChange> changes_;
  Localizer::Memory scratch_;
  Event described_;
  int next_ = 0;
  bool crowded_ = false;
};

}  // namespace touchline
