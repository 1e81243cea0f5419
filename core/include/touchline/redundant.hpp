// SPDX-License-Identifier: Apache-2.0
// A pipeline that carries on where a force-torque sensor is lost, with what the robot has left: each
// loss has a stand-in, the pipeline of the same robot without those sensors. There the segments on
// both sides of the lost sensor are one, and joint torques step in. What is said is put into the
// words of the whole robot. One belongs to one thread at a time; `update` allocates nothing.
//
// Before anything is estimated, each channel is judged (detail/gates): a faulty one is held or left
// out, told in `Result::faults`, and has no part in what is estimated. So is one that the others
// contradict in what the whole robot makes of a sample, from the next sample on, for a while.
//
// A stand-in is warmed up from the first sample without the sensor on, and speaks as soon as it has
// settled, 5 / K later. The whole robot speaks again 5 / K after the sensor is back. What stands on
// the arm while nothing touches it, the one tells the other. An event that both feel is one event.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "touchline/detail/events/suspicion.hpp"
#include "touchline/detail/gates/channel_gates.hpp"
#include "touchline/detail/gates/parity_watch.hpp"
#include "touchline/pipeline.hpp"

namespace touchline {

// A robot without some of its sensors, and where its parts stand in the whole robot.
struct StandIn {
  std::vector<int> lost;      // sensors of the whole robot that it does without
  Robot robot;
  std::vector<int> sensors;   // of the whole robot, for each of its own
  std::vector<int> segments;  // of the whole robot, for each of its own
  std::vector<int> rows;      // of the whole robot's detector, for each of its own; -1: none
  std::vector<Watch> watch;   // of each segment of the whole robot
};

class RedundantPipeline {
 public:
  // `stand_ins`: for the losses of sensors that it carries on after. Where several do, the one that
  // does without the fewest sensors. Throws std::invalid_argument where one does not fit the robot.
  explicit RedundantPipeline(Robot robot, const Tuning& tuning = {},
                             std::vector<StandIn> stand_ins = {})
      : whole_(std::move(robot), tuning),
        gates_(whole_.robot(), tuning.gates),
        parity_(whole_.robot(), whole_.observer(), whole_.loadable(), tuning.gates),
        resets_(whole_.row_layout()) {
    const Robot& own = whole_.robot();
    const std::size_t n = own.joints.size(), k = own.sensors.size();
    absent_.resize(k, 0);
    row_.resize(whole_.row_layout().width());
    levels_.resize(own.segment_names.size());
    suspicions_.resize(levels_.size());
    quiet_.resize(levels_.size());
    normalized_.resize(own.rows.size());
    drift_.resize(own.rows.size());
    contacts_.resize(levels_.size() * Reports::kMost);
    changes_.reserve(8 * levels_.size() * (Reports::kMost + 1));
    renumbered_.reserve(changes_.capacity());
    waiting_.reserve(levels_.size() * (Reports::kMost + 1));
    joints_ = n;
    sound_.resize(gates_.layout().count(), Fault::none);
    ratios_.resize(kAhead * sound_.size());
    until_.resize(sound_.size(), -kAbsurd);
    unsure_until_.resize(sound_.size(), -kAbsurd);
    faults_ = before_ = sound_;
    left_.resize(sound_.size());
    restarts_.resize(n + levels_.size(), 0);
    for (StandIn& given : stand_ins) add(std::move(given));
  }

  const RowLayout& row_layout() const { return whole_.row_layout(); }
  const Robot& robot() const { return whole_.robot(); }

  const ChannelLayout& channels() const { return gates_.layout(); }

  // Takes one sample; see `Pipeline::update`.
  Result update(const Sample& sample) {
    const Sample believed = gates_.judge(sample);
    return take(believed, gates_.faults(), gates_.ratios().data());
  }

  // Takes N samples; see `Pipeline::run`. The bits are those of `update`.
  template <class Each>
  void run(std::size_t samples, const double* time, const Sample& first, double* rows, Each&& each) {
    const std::size_t n = joints_, w = 6 * absent_.size(), width = row_.size();
    const auto at = [&](std::size_t i) {
      return Sample{time[i], first.q + i * n, first.qd + i * n, first.tau + i * n,
                    first.wrench + i * w};
    };
    for (std::size_t i = 0; i < samples;) {
      std::size_t end = i;  // of the samples from here on of which all is believed
      bool judged = false;  // is `believed` what is left of sample `end`?
      Sample believed{};
      while (!judged && healthy() && end < samples && end - i < kAhead) {
        believed = gates_.judge(at(end));
        find_absent(believed);
        judged = any_absent_ || !gates_.all_sound();
        if (judged) break;
        std::copy(gates_.ratios().begin(), gates_.ratios().end(),
                  ratios_.begin() + (end - i) * sound_.size());
        ++end;
      }
      if (end > i) {
        const double* ratios = ratios_.data();
        whole_.run(end - i, time + i, at(i), rows + i * width, [&](const Result& result) {
          watch_parity(result, time[i]);
          each(with_faults(result, sound_, ratios));
          ratios += sound_.size();
          ++i;
          return !contradicted_;
        });
        for (; i < end; ++i, ratios += sound_.size()) {  // judged, but not taken any more
          const Result result = take(at(i), sound_, ratios);
          std::copy(result.estimate.row().begin(), result.estimate.row().end(), rows + i * width);
          each(result);
        }
        if (!judged) continue;
      }
      if (!judged) believed = gates_.judge(at(i));
      const Result result = take(believed, gates_.faults(), gates_.ratios().data());
      std::copy(result.estimate.row().begin(), result.estimate.row().end(), rows + i * width);
      each(result);
      ++i;
    }
  }

  // Sensors that are done without.
  const std::vector<int>& lost() const { return now_ != nullptr ? now_->given.lost : none_; }

  template <class Visit>
  void visit_lasting(Visit&& visit) {
    Pipeline& from = now_ != nullptr ? now_->pipeline : whole_;
    from.visit_lasting([&](Event event) {
      rename(event);
      visit(static_cast<const Event&>(event));
    });
    for (const Event& event : waiting_) visit(event);
  }
  int next_event() const { return std::max(next_, whole_.next_event()); }
  void number_events_from(int next) {
    next_ = next;
    whole_.number_events_from(next);
  }
  double time() const { return whole_.time(); }
  // How often each estimate has begun anew, as `Result::resets`; another pipeline of this robot that
  // goes on for this one, with other figures, counts on from there.
  Span<Reset> resets() const { return {resets_.resets().data(), resets_.resets().size()}; }
  void count_resets_from(const RedundantPipeline& before) { resets_.go_on_from(before.resets_); }
  // The stand-ins of another pipeline of this very robot that begins anew: making one takes
  // milliseconds, and those that it never used are as new.
  void take_stand_ins(RedundantPipeline& before, std::vector<StandIn> given) {
    for (std::size_t i = 0; i < given.size(); ++i) {
      const bool fresh = i < before.stand_ins_.size() && !before.stand_ins_[i]->used;
      if (fresh)
        stand_ins_.push_back(std::move(before.stand_ins_[i]));
      else
        add(std::move(given[i]));
    }
    before.stand_ins_.clear();
    before.now_ = before.warming_ = before.parts_ = nullptr;
  }
  const RestMeter& rest() const { return whole_.rest(); }
  std::vector<SurfaceCell> region() const {
    return now_ != nullptr ? now_->pipeline.region() : whole_.region();
  }
  const Tuning& tuning() const { return whole_.tuning(); }
  const std::vector<LinkSurface>& surfaces() const { return whole_.surfaces(); }
  const TrackingState& tracking(int g) const { return whole_.tracking(g); }
  std::size_t rows() const { return whole_.rows(); }
  Standing standing(int row) const { return whole_.standing(row); }

 private:
  static constexpr std::size_t kAhead = 64;  // samples that are judged before they are taken

  // A sample of which the gates believe `judged`.
  Result take(const Sample& judged, const std::vector<Fault>& faults, const double* ratios) {
    const Sample believed = contradicted_ ? without_contradicted(judged) : judged;
    if (!gates_.all_sound()) {
      begin_anew();
      doubt_news(faults, judged.time);
    }
    find_absent(believed);
    const bool whole = healthy();
    const Result result = whole ? whole_.update(believed) : step(believed);
    if (whole) watch_parity(result, believed.time);
    else parity_.forget();
    return with_faults(result, faults, ratios);
  }

  // Of channels that pass again while they are still told nothing goes on from what they had.
  void begin_anew() {
    const ChannelLayout& at = gates_.layout();
    for (std::size_t c = at.tau(); c < at.count(); ++c) {
      if (!gates_.begins_to_pass(c)) continue;
      const bool torque = c < at.wrench();
      const std::size_t i = torque ? c - at.tau() : (c - at.wrench()) / 6;
      torque ? whole_.begin_torque_anew(i) : whole_.begin_sensor_anew(i);
      for (const std::unique_ptr<Second>& second : stand_ins_) {
        if (torque) {
          second->pipeline.begin_torque_anew(i);
        } else if (second->without[i] == 0) {
          const std::vector<int>& own = second->given.sensors;
          const auto found = std::find(own.begin(), own.end(), static_cast<int>(i));
          second->pipeline.begin_sensor_anew(static_cast<std::size_t>(found - own.begin()));
        }
      }
    }
  }

  // Is what the whole robot made of a sample contradictory? Then from the next sample on some
  // channel counts no more.
  void watch_parity(const Result& result, double time) {
    const double until = time + tuning().gates.contradicted;
    parity_.step(
        result, time,
        [&](std::size_t channel) {
          until_[channel] = until;
          contradicted_ = true;
        },
        [&](std::size_t channel) {
          unsure_until_[channel] = until;
          unsure_ = true;
        });
  }

  // What is left of a sample without the channels that others contradict. One whose time is over
  // counts again: what it has been wrong by is an offset that the whole robot begins with.
  Sample without_contradicted(const Sample& sample) {
    const ChannelLayout& at = gates_.layout();
    const std::size_t n = at.joints, w = 6 * at.sensors;
    std::copy_n(sample.q, n, left_.data() + at.q());
    std::copy_n(sample.qd, n, left_.data() + at.qd());
    std::copy_n(sample.tau, n, left_.data() + at.tau());
    std::copy_n(sample.wrench, w, left_.data() + at.wrench());
    contradicted_ = false;
    for (std::size_t c = at.tau(); c < at.count(); ++c) {
      if (sample.time >= until_[c]) until_[c] = -kAbsurd;
      if (!(until_[c] > -kAbsurd)) continue;
      left_[c] = kUnknown;
      contradicted_ = true;
    }
    return {sample.time, left_.data() + at.q(), left_.data() + at.qd(), left_.data() + at.tau(),
            left_.data() + at.wrench()};
  }

  Result with_faults(Result result, const std::vector<Fault>& faults, const double* ratios) {
    const bool faulty = &faults != &sound_ && !gates_.all_sound();
    if (faulty) result.health |= kFaulty | gates_.absent();
    const std::vector<Fault>* told = &faults;
    const bool suspected = std::any_of(result.suspects.begin(), result.suspects.end(),
                                       [](char suspect) { return suspect != 0; });
    if (contradicted_ || suspected || unsure_) {
      result.health |= kFaulty;
      faults_ = faults;
      for (std::size_t c = 0; c < faults_.size(); ++c) {
        if (faults_[c] == Fault::none && until_[c] > -kAbsurd) faults_[c] = Fault::disagrees;
      }
      for (std::size_t i = 0; i < result.suspects.size(); ++i) {
        Fault& fault = faults_[channel_of(i)];
        if (result.suspects[i] != 0 && fault == Fault::none) fault = Fault::suspect;
      }
      if (unsure_) tell_unsure(result.time);
      told = &faults_;
    }
    if (told != &sound_ || changing_) follow_faults(*told, result.time);
    result.faults = {told->data(), told->size()};
    result.ratios = {ratios, told->size()};
    count_resets(result);
    return result;
  }

  // Those of which one is wrong: each is suspect, and counts on.
  void tell_unsure(double time) {
    unsure_ = false;
    for (std::size_t c = 0; c < faults_.size(); ++c) {
      if (!(time < unsure_until_[c])) continue;
      unsure_ = true;
      if (faults_[c] == Fault::none) faults_[c] = Fault::suspect;
    }
  }

  // The channel of the whole robot that is channel `i` of the one that speaks.
  std::size_t channel_of(std::size_t i) const {
    const std::size_t first = gates_.layout().wrench();
    if (now_ == nullptr || i < first) return i;
    return first + 6 * now_->given.sensors[(i - first) / 6] + (i - first) % 6;
  }

  // A channel that comes to be wrong, or right again, or is at another level from now on: what begins
  // about then where it is felt may be no contact.
  void follow_faults(const std::vector<Fault>& told, double time) {
    changing_ = false;
    for (std::size_t c = 0; c < told.size(); ++c) {
      const bool news = told[c] != before_[c] && (is_wrong(told[c]) || is_wrong(before_[c]));
      const Moved moved = gates_.take_moved(c);
      if (moved == Moved::wrongly || news) doubt_where_felt(c, time, time - kUntold);
      else if (moved == Moved::alone) doubt_where_felt(c, time, kNever);  // it is no collision
      else if (told[c] == Fault::suspect && before_[c] == Fault::none && !(time < unsure_until_[c]))
        doubt_where_felt(c, time, time - kUntold, kUntold);  // what it brought beside contacts
      before_[c] = told[c];
      changing_ = changing_ || told[c] != Fault::none;
    }
  }

  // The same of what the gates tell now, before anything is made of the sample: what begins with it,
  // or was about to become a collision, is doubted, too.
  void doubt_news(const std::vector<Fault>& faults, double time) {
    for (std::size_t c = 0; c < faults.size(); ++c) {
      const Moved moved = gates_.moved_lately(c);
      const bool news = is_wrong(faults[c]) && faults[c] != before_[c];
      if (moved == Moved::wrongly || news) doubt_where_felt(c, time, time - kUntold);
      else if (moved == Moved::alone) doubt_where_felt(c, time, kNever);
    }
  }

  // What has begun since then [s] where a channel is felt is doubted, and none of it is a collision.
  void doubt_where_felt(std::size_t channel, double time, double since, double lasts = kDoubtful) {
    for (std::size_t g = 0; g < suspicions_.size(); ++g) {
      if (!feels(g, channel)) continue;
      const double until = time + lasts;
      suspicions_[g].extend(time, since, until);
      whole_.doubt(g, since, until);
      for (const std::unique_ptr<Second>& second : stand_ins_) {
        const std::vector<int>& told = second->given.segments;  // of its own ones, as told
        for (std::size_t i = 0; i < told.size(); ++i) {
          if (second->told_as[g] != told[i]) continue;
          second->used = true;
          second->pipeline.doubt(i, since, until);
        }
      }
    }
  }

  // Is a channel part of what segment g feels? Motion is part of all.
  bool feels(std::size_t g, std::size_t channel) const {
    const ChannelLayout& at = gates_.layout();
    if (channel < at.tau()) return true;
    if (channel < at.wrench()) {
      const int joint = static_cast<int>(channel - at.tau());
      const std::vector<DetectionRow>& rows = whole_.robot().rows;
      return std::any_of(rows.begin(), rows.end(), [&](const DetectionRow& row) {
        return row.joint == joint && row.segment == static_cast<int>(g);
      });
    }
    const int sensor = static_cast<int>((channel - at.wrench()) / 6);
    const Segment& segment = whole_.observer().layout().segments[g];
    const std::vector<int>& outer = segment.successors;
    return segment.sensor == sensor || std::find(outer.begin(), outer.end(), sensor) != outer.end() ||
           whole_.observer().layout().segment_of_sensor[sensor] < 0;  // it makes torques of joints
  }

  static bool is_wrong(Fault fault) {
    return fault == Fault::step || fault == Fault::wild || fault == Fault::stuck ||
           fault == Fault::disagrees;
  }

  // Of what is said, whoever says it: `Result::resets` is still that of who makes the estimate.
  void count_resets(Result& result) {
    if (now_ != spoke_) resets_.begin_anew();
    spoke_ = now_;
    const std::size_t n = joints_;
    for (std::size_t i = 0; i < result.resets.size(); ++i) {
      const std::size_t g = i < n || now_ == nullptr ? i : n + now_->given.segments[i - n];
      restarts_[g] = result.resets[i].count;
    }
    resets_.step(result.estimate.row().data(), [this](std::size_t i) { return restarts_[i]; });
    result.resets = resets();
  }

  static constexpr double kNever = std::numeric_limits<double>::infinity();  // [s]
  static constexpr double kUntold = 0.06;   // [s] for which a channel may be wrong before it is told
  static constexpr double kDoubtful = 1.0;  // [s] in which more of it may come

  // An event under another number than the one its pipeline gave it; `before`: it goes on with an
  // event that had been detected then.
  struct Renumbered {
    const Pipeline* of;
    int own, told;
    bool continues = false;
    double detected = kUnknown, decided = kUnknown;
    ContactLevel level = ContactLevel::contact;
  };

  struct Second {
    Second(StandIn of, const Tuning& tuning, std::size_t sensors)
        : given{std::move(of.lost), {}, std::move(of.sensors), std::move(of.segments),
                std::move(of.rows), std::move(of.watch)},
          pipeline(std::move(of.robot), tuning),
          wrench(6 * given.sensors.size()),
          without(sensors, 0) {
      for (const int s : given.lost) without[s] = 1;
    }
    StandIn given;  // without its robot, which the pipeline has
    Pipeline pipeline;
    std::vector<double> wrench;
    std::vector<char> without;  // per sensor of the whole robot
    bool used = false;          // has it been told anything?
    std::vector<int> told_as;   // per segment of the whole robot: the one that it is part of here
  };

  void add(StandIn given) {
    check(given);
    stand_ins_.push_back(std::make_unique<Second>(std::move(given), tuning(), absent_.size()));
    find_parts(*stand_ins_.back());
  }

  // Which segments of the whole robot are one where a stand-in speaks.
  void find_parts(Second& second) const {
    const Layout& layout = whole_.observer().layout();
    const Layout& own = second.pipeline.observer().layout();
    second.told_as.assign(levels_.size(), -1);
    for (std::size_t g = 0; g < own.segments.size(); ++g) {
      if (own.segments[g].sensor < 0) {  // its root has all that no sensor has
        for (int& part : second.told_as) part = part < 0 ? second.given.segments[g] : part;
      } else {
        const int sensor = second.given.sensors[own.segments[g].sensor];
        add_parts(second, layout, layout.segment_of_sensor[sensor], second.given.segments[g]);
      }
    }
  }
  void add_parts(Second& second, const Layout& layout, int segment, int told) const {
    second.told_as[segment] = told;
    for (const int t : layout.segments[segment].successors) {
      if (second.without[t] != 0) add_parts(second, layout, layout.segment_of_sensor[t], told);
    }
  }

  // Tells a stand-in what stands on the arm while nothing touches it.
  void teach(Second& second) {
    second.used = true;
    const std::vector<DetectionRow>& rows = second.pipeline.robot().rows;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const int known = second.given.rows[i];
      if (rows[i].joint >= 0 && known >= 0 && whole_.known_for(known) > 0.0)
        second.pipeline.go_on_from(whole_, known, static_cast<int>(i), whole_.baseline(known));
      if (rows[i].component == 0) teach_wrench(second, i);
    }
  }

  // The six rows of a segment from row `first` on: the sum of those of its parts.
  void teach_wrench(Second& second, std::size_t first) {
    const Observer& observer = whole_.observer();
    const std::vector<DetectionRow>& rows = second.pipeline.robot().rows;
    const std::vector<DetectionRow>& of = whole_.robot().rows;
    const int g = rows[first].segment, sensor = second.pipeline.observer().layout().segments[g].sensor;
    if (first + 6 > rows.size() || sensor < 0) return;
    Spatial sum{};
    double age = kAbsurd;
    for (std::size_t i = 0; i + 6 <= of.size(); ++i) {
      if (of[i].component != 0 || second.told_as[of[i].segment] != second.given.segments[g]) continue;
      const int part = observer.layout().segments[of[i].segment].sensor;
      if (part < 0) continue;
      double stands[6];
      for (int k = 0; k < 6; ++k) {
        stands[k] = whole_.baseline(static_cast<int>(i) + k);
        age = std::min(age, whole_.known_for(static_cast<int>(i) + k));
      }
      sum = sum + wrench_to_parent(observer.sensor_pose(part), load(stands));
    }
    if (!(age > 0.0) || age >= kAbsurd) return;
    double stands[6];
    store(wrench_to_child(observer.sensor_pose(second.given.sensors[sensor]), sum), stands);
    for (int k = 0; k < 6; ++k) {
      const int row = static_cast<int>(first) + k, known = second.given.rows[row];
      if (known >= 0) second.pipeline.go_on_from(whole_, known, row, stands[k]);
    }
  }

  void check(const StandIn& s) const {
    const Robot& own = whole_.robot();
    const auto within = [](const std::vector<int>& values, int least, std::size_t end) {
      return std::all_of(values.begin(), values.end(),
                         [&](int i) { return i >= least && i < static_cast<int>(end); });
    };
    const bool fits = s.robot.joints.size() == own.joints.size() &&
                      s.robot.links.size() == own.links.size() &&
                      s.sensors.size() == s.robot.sensors.size() &&
                      s.segments.size() == s.robot.segment_names.size() &&
                      s.rows.size() == s.robot.rows.size() &&
                      s.watch.size() == own.segment_names.size() &&
                      s.sensors.size() + s.lost.size() == own.sensors.size() &&
                      within(s.lost, 0, own.sensors.size()) &&
                      within(s.sensors, 0, own.sensors.size()) &&
                      within(s.segments, 0, own.segment_names.size()) &&
                      within(s.rows, -1, own.rows.size());
    if (!fits) throw std::invalid_argument("a stand-in does not fit the robot");
  }

  // Does the whole robot speak for itself, with all sensors and its own numbers of events?
  bool healthy() const {
    return now_ == nullptr && warming_ == nullptr && !any_absent_ && !contradicted_ &&
           renumbered_.empty() && waiting_.empty();
  }

  // Is a six-axis sensor without a reading that counts? One that settles again has yet to.
  bool absent(const Sample& sample, std::size_t s) const {
    const SensorRow& sensor = whole_.robot().sensors[s];
    double sum = 0.0;
    for (int i = 0; i < 6; ++i) {
      if (!sensor.axes[i]) continue;
      if (gates_.passes(gates_.layout().wrench() + 6 * s + i)) return true;
      sum += std::fabs(sample.wrench[6 * s + i]);
    }
    return !(sum < kAbsurd);
  }
  void find_absent(const Sample& sample) {
    any_absent_ = false;
    for (std::size_t s = 0; s < absent_.size(); ++s) {
      absent_[s] = absent(sample, s);
      any_absent_ = any_absent_ || absent_[s] != 0;
    }
  }

  // The stand-in that does without just these sensors, or with the fewest others too; null: none.
  Second* stand_in() const {
    Second* best = nullptr;
    for (const std::unique_ptr<Second>& second : stand_ins_) {
      bool covers = true;
      for (std::size_t s = 0; s < absent_.size(); ++s)
        covers = covers && (absent_[s] == 0 || second->without[s] != 0);
      if (covers && (best == nullptr || second->given.lost.size() < best->given.lost.size()))
        best = second.get();
    }
    return best;
  }

  Result step(const Sample& sample) {
    changes_.clear();
    Second* const needed = any_absent_ ? stand_in() : nullptr;
    const Result of_whole = whole_.update(sample);  // it settles anew as soon as all are back
    Result of_now = now_ != nullptr ? feed(*now_, sample) : of_whole;
    Second* const before = std::exchange(warming_, needed != now_ ? needed : nullptr);
    if (warming_ != nullptr && warming_ != before) teach(*warming_);
    if (!waiting_.empty() && !(whole_.time() < handed_over_ + tuning().gates.continues)) {
      for (Event& event : waiting_) {
        event.cleared = handed_over_;
        if (is_doubted(event)) doubt(event);
        tell(Happened::ended, event);
      }
      waiting_.clear();
    }
    if (warming_ != nullptr) {
      const Result of_warming = feed(*warming_, sample);
      if (settled(of_warming)) {
        now_ = hand_over(std::exchange(warming_, nullptr));
        of_now = of_warming;
      }
    } else if (now_ != nullptr && !any_absent_ && settled(of_whole)) {
      now_ = hand_over(nullptr);
      of_now = of_whole;
    }
    if (now_ == nullptr) return with_changes(of_now);
    // What is wrong with the sample itself, the whole robot tells.
    of_now.health |= (of_whole.health & ~kSettling) | kSensorExcluded;
    return said(*now_, of_now);
  }

  Result feed(Second& second, const Sample& sample) {
    second.used = true;
    for (std::size_t s = 0; s < second.given.sensors.size(); ++s)
      std::copy_n(sample.wrench + 6 * second.given.sensors[s], 6, second.wrench.data() + 6 * s);
    return second.pipeline.update(
        {sample.time, sample.q, sample.qd, sample.tau, second.wrench.data()});
  }

  static bool settled(const Result& result) { return (result.health & kSettling) == 0; }

  Pipeline& pipeline_of(Second* second) { return second != nullptr ? second->pipeline : whole_; }

  // Events that last wait for the other one to feel them too.
  Second* hand_over(Second* to) {
    Pipeline &from = pipeline_of(now_), &next = pipeline_of(to);
    handed_over_ = whole_.time();
    from.visit_lasting([&](Event event) {
      rename(event);
      if (event.doubted || is_doubted(event)) {  // the next one does not go on with it
        doubt(event);
        event.cleared = handed_over_;
        tell(Happened::ended, event);
      } else if (waiting_.size() < waiting_.capacity()) {
        waiting_.push_back(event);
      }
    });
    next_ = next_event();
    renumbered_.clear();
    parts_ = to != nullptr ? to : now_;
    now_ = to;
    next.visit_lasting([&](const Event& event) { begin(next, event); });
    if (to == nullptr) whole_.number_events_from(next_);
    return to;
  }

  // An event of the one that speaks now has begun: is it one of those that last?
  void begin(const Pipeline& of, Event event) {
    if (known(of, event.id) == nullptr) go_on(of, event);
    const bool continues = known(of, event.id) != nullptr && known(of, event.id)->continues;
    rename(event);
    tell(continues ? Happened::changed : Happened::began, event);
  }

  // The event of `waiting_` that an event of the one that speaks now goes on with, if any.
  void go_on(const Pipeline& of, const Event& own) {
    const int segment = now_ != nullptr ? now_->given.segments[own.segment] : own.segment;
    for (Event& event : waiting_) {
      const bool one = event.segment == segment ||
                       parts_->told_as[event.segment] == parts_->told_as[segment];
      if (!one || renumbered_.size() >= renumbered_.capacity()) continue;
      renumbered_.push_back(
          {&of, own.id, event.id, true, event.detected, event.decided, event.level});
      event = waiting_.back();
      waiting_.pop_back();
      return;
    }
  }

  const Renumbered* known(const Pipeline& of, int own) const {
    for (const Renumbered& r : renumbered_) {
      if (r.of == &of && r.own == own) return &r;
    }
    return nullptr;
  }

  void tell(Happened happened, const Event& event) {
    if (changes_.size() < changes_.capacity()) changes_.push_back({happened, event});
  }
  // Has an event begun when a channel was not what it was?
  bool is_doubted(const Event& event) const {
    for (std::size_t g = 0; g < suspicions_.size(); ++g) {
      const bool here = static_cast<int>(g) == event.segment ||
                        (parts_ != nullptr && parts_->told_as[g] == parts_->told_as[event.segment]);
      if (here && suspicions_[g].meets(whole_.time(), event.detected)) return true;
    }
    return false;
  }

  // The number under which an event of the one that speaks is told.
  int number(const Pipeline& of, int own) {
    if (const Renumbered* r = known(of, own)) return r->told;
    if (&of == &whole_ && now_ == nullptr && own >= next_) return own;
    if (renumbered_.size() < renumbered_.capacity()) renumbered_.push_back({&of, own, next_, false});
    return next_++;
  }

  void rename(Event& event) {
    const Pipeline& of = pipeline_of(now_);
    const int own = event.id;
    event.id = number(of, own);
    if (const Renumbered* r = known(of, own); r != nullptr && r->continues) {
      event.detected = r->detected;
      event.level = std::max(event.level, r->level);
      if (r->decided == r->decided) event.decided = r->decided;
    }
    if (now_ != nullptr) event.segment = now_->given.segments[event.segment];
  }

  void rename(const Pipeline& of, Contact& contact) {
    const Renumbered* r = known(of, contact.event);
    if (r != nullptr && r->continues) contact.level = std::max(contact.level, r->level);
    contact.event = number(of, contact.event);
  }

  // What a stand-in says, in the words of the whole robot.
  Result said(const Second& second, const Result& r) {
    const StandIn& by = second.given;
    for (const EventChange& change : r.events) {  // before contacts ask for its number
      const bool news = change.happened == Happened::began;
      if (news && known(second.pipeline, change.event.id) == nullptr)
        go_on(second.pipeline, change.event);
    }
    put_row(second, r);
    std::fill(levels_.begin(), levels_.end(), 0);
    std::fill(quiet_.begin(), quiet_.end(), 0.0);
    std::fill(normalized_.begin(), normalized_.end(), 0.0);
    std::fill(drift_.begin(), drift_.end(), 0.0);
    for (std::size_t g = 0; g < by.segments.size(); ++g) {
      levels_[by.segments[g]] = std::max(levels_[by.segments[g]], r.levels[g]);
      quiet_[by.segments[g]] = r.quiet[g];
    }
    for (std::size_t i = 0; i < by.rows.size(); ++i) {
      if (by.rows[i] < 0) continue;
      normalized_[by.rows[i]] = r.normalized[i];
      drift_[by.rows[i]] = r.drift[i];
    }
    const std::size_t count = std::min(r.contacts.size(), contacts_.size());
    for (std::size_t i = 0; i < count; ++i) {
      contacts_[i] = r.contacts[i];
      contacts_[i].segment = by.segments[contacts_[i].segment];
    }
    for (std::size_t i = 0; i < count; ++i) rename(second.pipeline, contacts_[i]);
    Result told = with_changes(r);
    told.estimate = Estimate(row_.data(), whole_.row_layout());
    told.levels = {levels_.data(), levels_.size()};
    told.normalized = {normalized_.data(), normalized_.size()};
    told.drift = {drift_.data(), drift_.size()};
    told.quiet = {quiet_.data(), quiet_.size()};
    told.watch = {by.watch.data(), by.watch.size()};
    told.contacts = {contacts_.data(), count};
    return told;
  }

  // Its events after those of a change.
  Result with_changes(const Result& r) {
    const Pipeline& speaker = pipeline_of(now_);
    for (EventChange change : r.events) {
      const int own = change.event.id;
      if (change.happened == Happened::began) {
        if (!told(own)) begin(speaker, change.event);
        continue;
      }
      rename(change.event);
      tell(change.happened, change.event);
      if (change.happened != Happened::ended) continue;
      renumbered_.erase(std::remove_if(renumbered_.begin(), renumbered_.end(),
                                       [&](const Renumbered& known) {
                                         return known.of == &speaker && known.own == own;
                                       }),
                        renumbered_.end());
    }
    Result told = r;
    if (now_ == nullptr && !renumbered_.empty()) {
      for (std::size_t i = 0; i < r.contacts.size() && i < contacts_.size(); ++i) {
        contacts_[i] = r.contacts[i];
        rename(whole_, contacts_[i]);
      }
      told.contacts = {contacts_.data(), std::min(r.contacts.size(), contacts_.size())};
    }
    told.events = {changes_.data(), changes_.size()};
    return told;
  }

  // Has this sample's hand-over told of an event of the one that speaks now?
  bool told(int own) const {
    const Renumbered* r = known(now_ != nullptr ? now_->pipeline : whole_, own);
    if (r == nullptr && now_ != nullptr) return false;
    const int id = r != nullptr ? r->told : own;
    return std::any_of(changes_.begin(), changes_.end(),
                       [id](const EventChange& c) { return c.event.id == id; });
  }

  void put_row(const Second& second, const Result& r) {
    const StandIn& by = second.given;
    const RowLayout &to = whole_.row_layout(), &from = second.pipeline.row_layout();
    const double* in = r.estimate.row().data();
    double* out = row_.data();
    std::fill(row_.begin(), row_.end(), kUnknown);
    std::copy_n(in, 4 * from.joints, out);  // torques, own ones, parity, innovations
    std::copy_n(in + from.joint_settled(), from.joints, out + to.joint_settled());
    std::copy_n(in + from.joint_gap_std(), from.joints, out + to.joint_gap_std());
    std::fill_n(out + to.segment_settled(), to.segments, 0.0);
    for (int s = 0; s < from.sensors; ++s)
      std::copy_n(in + from.sensor_wrench() + 6 * s, 6, out + to.sensor_wrench() + 6 * by.sensors[s]);
    for (int g = 0; g < from.segments; ++g) {
      const int h = by.segments[g];
      std::copy_n(in + from.segment_wrench() + 6 * g, 6, out + to.segment_wrench() + 6 * h);
      std::copy_n(in + from.segment_innovation() + 6 * g, 6, out + to.segment_innovation() + 6 * h);
      out[to.segment_settled() + h] = in[from.segment_settled() + g];
      std::copy_n(in + from.segment_gap_std() + 2 * g, 2, out + to.segment_gap_std() + 2 * h);
    }
    out[to.health()] = static_cast<double>(r.health);
  }

  Pipeline whole_;
  ChannelGates gates_;
  ParityWatch parity_;
  std::vector<double> until_, left_;  // per channel: when it counts again [s]; what is left of it
  std::vector<Fault> faults_;         // of gates, parity and what is suspected together
  std::vector<Fault> before_;         // as told of the sample before
  bool changing_ = false;             // is any of these a fault?
  std::vector<Suspicion> suspicions_;  // per segment
  bool contradicted_ = false;         // does any channel count no more?
  std::vector<double> unsure_until_;  // per channel: until when it is one of several, one wrong [s]
  bool unsure_ = false;               // is any?
  ResetWatch resets_;
  std::vector<std::uint32_t> restarts_;  // per joint, then per segment: as told by who speaks
  const Second* spoke_ = nullptr;        // at the last sample
  std::vector<Fault> sound_;    // of channels that are all believed
  std::vector<double> ratios_;  // (kAhead, channels)
  std::vector<std::unique_ptr<Second>> stand_ins_;
  Second *now_ = nullptr, *warming_ = nullptr;  // who speaks, if not the whole; who shall
  Second* parts_ = nullptr;      // of the last hand-over: it says which segments are one
  std::vector<Event> waiting_;   // that lasted then, and that the next one has not felt yet
  double handed_over_ = kUnknown;  // [s]
  bool any_absent_ = false;
  std::size_t joints_ = 0;
  std::vector<char> absent_;  // per sensor, at the last sample
  std::vector<double> row_, quiet_, normalized_, drift_;
  std::vector<int> levels_, none_;
  std::vector<Contact> contacts_;
  std::vector<EventChange> changes_;
  std::vector<Renumbered> renumbered_;
  int next_ = 0;  // number of the next event, as far as told
};

}  // namespace touchline
