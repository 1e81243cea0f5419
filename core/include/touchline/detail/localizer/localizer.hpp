// SPDX-License-Identifier: Apache-2.0
// Where each segment is touched, and where each event is, from all its samples. No allocation per
// sample.
// Theory: docs/theory.md, section 6.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "touchline/detail/localizer/event_place.hpp"
#include "touchline/detail/localizer/link_evidence.hpp"
#include "touchline/detail/localizer/tracks.hpp"

namespace touchline {

class Localizer {
 public:
  Localizer(const Observer& observer, std::vector<DetectionRow> tests, NoiseFigures noise,
            std::vector<LinkSurface> surfaces, LocalizerSettings settings)
      : observer_(observer),
        settings_(settings),
        period_(noise.period),
        measurement_(observer, std::move(tests), std::move(noise), settings_),
        single_(observer, measurement_.posture(), settings_, std::move(surfaces)),
        tracks_(single_, measurement_, settings_, measurement_.most_rows(),
                observer.row_layout().segments, period_, observer),
        links_(observer, single_.surfaces(), settings_, measurement_.torque_error(), period_),
        states_(observer.row_layout().segments),
        memories_(observer.row_layout().segments, std::vector<Memory>(Reports::kMost + 1)) {
    for (std::vector<Memory>& of_segment : memories_) {
      for (Memory& m : of_segment) {
        m.q.resize((EventPlace::kPlaces + 1) * observer.row_layout().joints, kNaN);
        m.links = links_.shares();
      }
    }
    ended_.reserve(Reports::kMost + 1);
  }

  Localizer(const Localizer&) = delete;
  Localizer& operator=(const Localizer&) = delete;

  const std::vector<LinkSurface>& surfaces() const { return single_.surfaces().all(); }
  // The posterior of the place of the only contact of the last sample, cell by cell; throws where
  // there are several or none, or where that one's place is not this sample's.
  std::vector<SurfaceCell> region() const {
    const Answer& own = single_.answer();
    const bool same = said_ == 1 && placed(*last_) && placed(own) &&
                      (shared_ || !(norm(last_->candidates[0].point - own.candidates[0].point) > 0.0));
    if (!same)
      throw std::invalid_argument("the last sample does not speak of the place of a single contact");
    std::vector<SurfaceCell> cells = single_.region();
    if (shared_) share_out(cells);
    return cells;
  }
  const LocalizerSettings& settings() const { return settings_; }
  const Measurement& measurement() const { return measurement_; }

  // Sizes of what the methods below take.
  std::size_t joints() const { return observer_.row_layout().joints; }
  std::size_t segments() const { return observer_.row_layout().segments; }
  std::size_t tests() const { return measurement_.tests(); }
  std::size_t width() const { return observer_.row_layout().width(); }

  // Throws unless arrays of these sizes belong to this robot.
  void expect(int segment, std::size_t row, std::size_t normalized, std::size_t q,
              std::size_t qd) const {
    if (segment < 0 || static_cast<std::size_t>(segment) >= segments())
      throw std::invalid_argument("there is no such segment");
    if (row != width() || normalized != tests() || q != joints() || qd != joints())
      throw std::invalid_argument("an array has a size that does not belong to this robot");
  }

  // Of the sample: its configuration `q`, `qd`. `drift`: what the model's errors may have added to
  // each row of the detector since its baseline. `quiet`: for how long the baseline of each segment
  // has been averaged. `excess`: how many times as large as told the noise of each row is. All but
  // `q` may be null. `wrench_off`: does any wrench of the arm stand off?
  void set_state(const double* q, const double* qd, const double* drift, const double* quiet,
                 const double* excess = nullptr, bool wrench_off = false) {
    measurement_.set_state(q, qd, drift, quiet, excess, wrench_off);
    said_ = 0;
    shared_ = false;
  }

  // Covariance (6, 6) of a segment's wrench; false where it has none.
  bool wrench_covariance(int g, const double* row, double* out) {
    if (!measurement_.read(g, row, nullptr) || !measurement_.has_wrench()) return false;
    measurement_.wrench_covariance(out);
    return true;
  }

  // The contact on segment g, from the observer's row and the detector's normalized rows (or null).
  // A wrench that has been steady for a while is as old as its filter, 1 / K.
  const Answer& locate(int g, const double* row, const double* normalized) {
    return locate(g, row, normalized, steady_lag(g));
  }

  const Answer& locate(int g, const double* row, const double* normalized, double lag) {
    said_ = 1;
    last_ = &single_.answer();
    if (!measurement_.read(g, row, normalized)) return single_.clear();
    return single_.locate(g, lag, measurement_, {Ask::kSole, false, true});
  }

  // Takes a sample [row of the observer] at `time` [s] in which nothing touches segment g.
  void rest(int g, const double* row, double time) {
    if (g == links_.segment()) links_.rest(row, time);
  }

  // Takes a sample of segment g at `time` [s]: what is said of each contact on it is in `reports()`,
  // and the events that have ended in `ended()`.
  void follow(int g, bool touched, const double* row, const double* normalized, double time,
              const double* q) {
    SegmentContacts& s = states_[g];
    ended_.clear();
    if (touched && s.state.is(Tracking::quiet)) {
      s.begin(tracks_.begin(g), time);
      if (g == links_.segment()) links_.begin();
    }
    if (!touched) {
      if (!s.state.is(Tracking::quiet)) end_all(g);
      s.state.enter(Tracking::quiet);
      return;
    }
    tracks_.follow(s, g, bandwidth(g), time,
                   [&] { return measurement_.read(g, row, normalized); });
    if (g == links_.segment()) weigh_links(row, q);
    const Reports& reports = tracks_.reports();
    for (int i = 0; i < reports.ended(); ++i) end(g, reports.ended(i));
    said_ += reports.count();
    if (reports.count() > 0) last_ = &reports[0].answer;
    const double strength = measurement_.strength(g, normalized);
    for (int i = 0; i < reports.count(); ++i)
      remember(g, reports[i], reports.share(i) * strength, time, q);
  }

  const Reports& reports() const { return tracks_.reports(); }
  // Of segment g: in which state its contacts are, and which transitions there were.
  const TrackingState& state(int g) const { return states_[g].state; }
  // A channel that alone would show what is felt, or what known contacts leave of it.
  const Suspect& suspect() const { return tracks_.suspect(); }
  // From now on until then [s] a channel tells nothing of contacts where another one does.
  void leave_out(int channel, double until) { tracks_.leave_out(channel, until); }
  // From the next sample on so many pipelines take each: they share its work.
  void share_work(int pipelines) { tracks_.share_work(pipelines); }

  // An event: its number, its places, and the joint positions at the time of its position.
  struct Memory {
    int serial = -1;
    EventPlace event;
    std::vector<double> q;  // of each place's slot, and last those of the last strong sample
    bool undetermined = false;  // were there fewer equations than unknowns?
    std::vector<BodyShare> links;  // what joint torques say of each body, if `revision` is not -1
    int revision = -1;
  };

  // Those that ended with the last sample; those that last or were the last on segment g.
  const std::vector<Memory*>& ended() const { return ended_; }
  std::vector<Memory>& memories(int g) { return memories_[g]; }

  // Weighs the places of an event, those of the most probable body first.
  void conclude(Memory& m) {
    const auto node = [this](int surface) { return surfaces()[surface].node; };
    m.event.conclude(node, settings_);
    if (m.revision >= 0) m.event.share_out(m.links, node, settings_);
  }

  // Joint positions at the time of its most probable place.
  const double* positions(const Memory& m) const {
    const int slot = m.event.slot();
    return m.q.data() + (slot >= 0 ? slot : EventPlace::kPlaces) * joints();
  }

  Status status(const Memory& m) const {
    const EventPlace& event = m.event;
    if (event.count() == 0 || event.mostly_unexplained())
      return static_cast<Status>(event.frequent(3, 4));
    double here = 0.0;
    for (int i = 0; i < event.count(); ++i) {
      const Place &a = event.place(0), &b = event.place(i);
      if (a.surface == b.surface && norm(a.point - b.point) < settings_.place_radius)
        here += b.share;
    }
    const bool sharp = event.variance() < settings_.spread_limit() * settings_.spread_limit();
    const bool sure = event.may_be_sure() && here >= settings_.certain && sharp && !m.undetermined;
    return sure ? Status::located : Status::ambiguous;
  }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  // Finds the memory of an event, or makes room for it in place of one that has ended.
  Memory& memory(int g, int serial) {
    Memory* room = nullptr;
    for (Memory& m : memories_[g]) {
      if (m.serial == serial) return m;
      if (m.serial < 0 && room == nullptr) room = &m;
    }
    if (room == nullptr) room = &memories_[g].back();
    room->serial = serial;
    room->event.restart();
    room->revision = -1;
    return *room;
  }

  void end(int g, int serial) {
    for (Memory& m : memories_[g]) {
      if (m.serial == serial) ended_.push_back(&m);
    }
  }
  void end_all(int g) {
    for (Memory& m : memories_[g]) {
      if (m.serial >= 0) ended_.push_back(&m);
    }
  }

  // Adds what is said of a contact to its event.
  void remember(int g, const Report& report, double strength, double time, const double* q) {
    Memory& m = memory(g, report.serial);
    const Answer& answer = report.answer;
    if (shared_ && m.revision != links_.revision()) {
      std::copy(links_.shares().begin(), links_.shares().end(), m.links.begin());
      m.revision = links_.revision();
    }
    const double independence = 0.5 * period_ * bandwidth(g);
    const bool by_wrench = measurement_.has_wrench();
    if (!m.event.begin_sample(strength, by_wrench, time, independence, settings_)) return;
    if (reports().count() > 1) m.event.follow();
    keep(m, EventPlace::kPlaces, q);
    const bool explained =
        answer.status == Status::located || answer.status == Status::ambiguous;
    if (!m.event.open(static_cast<int>(answer.status), explained)) return;
    m.undetermined = answer.rank < answer.unknowns;
    for (int i = 0; i < answer.count; ++i) {
      const Candidate& k = answer.candidates[i];
      const Vec3 point = single_.surfaces().to_node(k.point, surfaces()[k.surface].node);
      const bool sure = i == 0 && answer.status == Status::located;
      keep(m, m.event.add(k.surface, point, k.weight, k.along[0] + k.along[2], sure, settings_), q);
    }
    m.event.close(explained ? answer.spread * answer.spread : kNaN, answer.lasting, settings_);
  }

  // Joint positions of a sample.
  void keep(Memory& m, int slot, const double* q) {
    if (slot >= 0) std::copy(q, q + joints(), m.q.begin() + slot * joints());
  }

  // What the step of the joint torques says of each body.
  void weigh_links(const double* row, const double* q) {
    if (!measurement_.can_be_followed()) links_.take(row, q, measurement_, tracks_.searched());
    shared_ = links_.known() && tracks_.share_out(links_.shares());
  }

  // Of a body that the last sample alone does not explain, the best patch is a cell.
  void share_out(std::vector<SurfaceCell>& cells) const {
    for (const BodyShare& of : links_.shares()) {
      const double here = on_body(cells, of.node);
      for (SurfaceCell& c : cells) {
        if (surfaces()[c.surface].node != of.node) continue;
        c.probability *= of.share / here;
        c.log_density += std::log(std::max(of.share / here, 1e-300));
      }
      if (here > 0.0 || !(of.share > 0.0)) continue;
      const LinkSurfaces& all = single_.surfaces();
      const double area = 12.0 * of.radius * of.radius;
      cells.push_back({of.surface, all.to_world(of.point, of.node), all.turn_to_world(of.normal, of.node),
                       area, std::log(of.share / area), of.share});
    }
  }

  double on_body(const std::vector<SurfaceCell>& cells, int node) const {
    double sum = 0.0;
    for (const SurfaceCell& c : cells) sum += surfaces()[c.surface].node == node ? c.probability : 0.0;
    return sum;
  }

  double steady_lag(int g) const {
    return observer_.layout().segments[g].sensor >= 0 ? 1.0 / bandwidth(g) : 0.0;
  }

  double bandwidth(int g) const {
    const int sensor = observer_.layout().segments[g].sensor;
    if (sensor >= 0) return observer_.sensors()[sensor].bandwidth;
    double least = std::numeric_limits<double>::infinity();
    for (const JointRow& joint : observer_.joints()) least = std::min(least, joint.bandwidth);
    return least;
  }

  const Observer& observer_;
  LocalizerSettings settings_;
  double period_;
  Measurement measurement_;
  SingleContact single_;
  Tracks tracks_;
  LinkEvidence links_;
  std::vector<SegmentContacts> states_;              // per segment
  std::vector<std::vector<Memory>> memories_;  // per segment: of events
  std::vector<Memory*> ended_;
  bool shared_ = false;  // has the evidence for links been given to the answer of the last sample?
  int said_ = 0;  // contacts of which something was said in the last sample, and of one of them what
  const Answer* last_ = nullptr;
};

}  // namespace touchline
