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
// A stand-in begins with the last sample of the whole robot, and goes on with what that has filtered.
// It speaks once a few samples are lost: at once where it alone feels something, else as soon as the
// whole robot's estimates could not go on any more. The whole robot speaks again 5 / K after the
// sensor is back; the stand-in listens until what it felt has ended. What stands on the arm while
// nothing touches it, the one tells the other. An event that both feel is one event.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "touchline/detail/gates/channel_gates.hpp"
#include "touchline/detail/gates/parity_watch.hpp"
#include "touchline/detail/redundant/absent_sensors.hpp"
#include "touchline/detail/redundant/channel_doubts.hpp"
#include "touchline/detail/redundant/deputy.hpp"
#include "touchline/detail/redundant/kept_sample.hpp"
#include "touchline/detail/redundant/left_out.hpp"
#include "touchline/detail/redundant/spoken_resets.hpp"
#include "touchline/detail/redundant/told_events.hpp"
#include "touchline/detail/redundant/whole_words.hpp"
#include "touchline/pipeline.hpp"

namespace touchline {

class RedundantPipeline {
 public:
  // Where several of the robot's stand-ins do, the one steps in that does without the fewest sensors.
  // Throws std::invalid_argument where the robot's parts do not fit together.
  explicit RedundantPipeline(Robot robot, const Tuning& tuning = {})
      : RedundantPipeline(std::move(robot.stand_ins), std::move(robot), tuning) {}

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
    const std::size_t n = gates_.layout().joints, w = 6 * gates_.layout().sensors,
                      width = row_layout().width();
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
        absent_.find(believed, gates_, robot());
        judged = absent_.any() || gates_.any_unproven();
        if (judged) break;
        std::copy(gates_.ratios().begin(), gates_.ratios().end(),
                  ratios_.begin() + (end - i) * sound_.size());
        ++end;
      }
      if (end > i) {
        const double* ratios = ratios_.data();
        whole_.share_work(1);
        std::size_t taken = end;  // the last sample that the whole robot took
        whole_.run(end - i, time + i, at(i), rows + i * width, [&](const Result& result) {
          watch_parity(result, time[i]);
          if (takes(result)) taken = i;
          each(with_faults(result, sound_, ratios));
          ratios += sound_.size();
          ++i;
          return !left_out_.any();
        });
        if (taken < end) last_.keep(at(taken));
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
  const std::vector<int>& lost() const { return now_ != nullptr ? now_->given().lost : none_; }

  template <class Visit>
  void visit_lasting(Visit&& visit) {
    events_.visit_lasting(now_, visit);
  }
  int next_event() const { return events_.next(); }
  void number_events_from(int next) { events_.number_from(next); }
  double time() const { return whole_.time(); }
  // How often each estimate has begun anew, as `Result::resets`; another pipeline of this robot that
  // goes on for this one, with other figures, counts on from there.
  Span<Reset> resets() const { return resets_.all(); }
  void count_resets_from(const RedundantPipeline& before) { resets_.go_on_from(before.resets_); }
  // The stand-ins of another pipeline of this very robot that begins anew: making one takes
  // milliseconds, and those that it never used are as new.
  void take_stand_ins(RedundantPipeline& before, std::vector<StandIn> given) {
    deputies_.take(before.deputies_, std::move(given), whole_);
    before.now_ = before.warming_ = nullptr;
    before.events_.forget_parts();
  }
  const RestMeter& rest() const { return whole_.rest(); }
  std::vector<SurfaceCell> region() const {
    return now_ != nullptr ? now_->pipeline().region() : whole_.region();
  }
  const Tuning& tuning() const { return whole_.tuning(); }
  const std::vector<LinkSurface>& surfaces() const { return whole_.surfaces(); }
  const TrackingState& tracking(int g) const { return whole_.tracking(g); }
  std::size_t rows() const { return whole_.rows(); }
  Standing standing(int row) const { return whole_.standing(row); }

 private:
  RedundantPipeline(std::vector<StandIn> stand_ins, Robot&& robot, const Tuning& tuning)
      : whole_(std::move(robot), tuning),
        gates_(whole_.robot(), tuning.gates),
        parity_(whole_.robot(), whole_.observer(), whole_.loadable(), tuning.gates),
        left_out_(gates_.layout()),
        doubts_(whole_, deputies_, gates_),
        events_(whole_, doubts_, tuning.gates.continues),
        words_(whole_),
        resets_(whole_.row_layout(), whole_.robot().joints.size(),
                whole_.robot().segment_names.size()),
        absent_(whole_.robot().sensors.size()),
        last_(gates_.layout().joints, gates_.layout().sensors),
        sound_(gates_.layout().count(), Fault::none),
        faults_(sound_),
        ratios_(kAhead * sound_.size()) {
    for (StandIn& given : stand_ins) deputies_.add(std::move(given), whole_);
  }

  static constexpr std::size_t kAhead = 64;  // samples that are judged before they are taken

  // Does the whole robot speak for itself, with all sensors and its own numbers of events?
  bool healthy() const {
    return now_ == nullptr && warming_ == nullptr && !absent_.any() && !left_out_.any() &&
           events_.plain() && !listening_;
  }

  // A sample of which the gates believe `judged`.
  Result take(const Sample& judged, const std::vector<Fault>& faults, const double* ratios) {
    const Sample believed = left_out_.any() ? left_out_.without(judged) : judged;
    if (!gates_.all_sound()) begin_anew();
    if (gates_.any_unproven()) doubts_.foresee(faults, judged.time);
    absent_.find(believed, gates_, robot());
    const bool whole = healthy();
    if (whole) whole_.share_work(1);
    const Result result = whole ? whole_.update(believed) : step(believed);
    if (whole) watch_parity(result, believed.time);
    else parity_.forget();
    if (takes(result)) last_.keep(believed);
    return with_faults(result, faults, ratios);
  }

  // Has the whole robot taken the sample of a result? A stand-in may begin with that.
  bool takes(const Result& result) const {
    return (result.health & kBadTime) == 0 && result.time == whole_.time();
  }

  // Of channels that pass again while they are still told nothing goes on from what they had.
  void begin_anew() {
    const ChannelLayout& at = gates_.layout();
    for (std::size_t c = at.tau(); c < at.count(); ++c) {
      if (!gates_.begins_to_pass(c)) continue;
      const bool torque = c < at.wrench();
      const std::size_t i = torque ? c - at.tau() : (c - at.wrench()) / 6;
      torque ? whole_.begin_torque_anew(i) : whole_.begin_sensor_anew(i);
      deputies_.visit([&](Deputy& deputy) {
        torque ? deputy.begin_torque_anew(i) : deputy.begin_sensor_anew(i);
      });
    }
  }

  // Is what the whole robot made of a sample contradictory? Then from the next sample on some
  // channel counts no more.
  void watch_parity(const Result& result, double time) {
    const double until = time + tuning().gates.contradicted;
    parity_.step(
        result, time, [&](std::size_t channel) { left_out_.leave_out(channel, until); },
        [&](std::size_t channel) { left_out_.be_unsure_of(channel, until); });
  }

  // What the gates tell, with what others contradict and what is suspected.
  Result with_faults(Result result, const std::vector<Fault>& faults, const double* ratios) {
    const bool faulty = &faults != &sound_ && !gates_.all_sound();
    if (faulty) result.health |= kFaulty | gates_.absent();
    const std::vector<Fault>* told = &faults;
    const bool suspected = std::any_of(result.suspects.begin(), result.suspects.end(),
                                       [](char suspect) { return suspect != 0; });
    if (left_out_.any() || suspected || left_out_.any_unsure()) {
      result.health |= kFaulty;
      faults_ = faults;
      left_out_.tell(faults_);
      for (std::size_t i = 0; i < result.suspects.size(); ++i) {
        Fault& fault = faults_[channel_of(i)];
        if (result.suspects[i] != 0 && fault == Fault::none) fault = Fault::suspect;
      }
      if (left_out_.any_unsure()) left_out_.tell_unsure(faults_, result.time);
      told = &faults_;
    }
    const bool news = told == &faults_ || faulty || gates_.any_moved();
    if ((told != &sound_ && news) || doubts_.pending()) doubts_.follow(*told, left_out_, result.time);
    result.faults = {told->data(), told->size()};
    result.ratios = {ratios, told->size()};
    resets_.count(result, now_);
    return result;
  }

  // The channel of the whole robot that is channel `i` of the one that speaks.
  std::size_t channel_of(std::size_t i) const {
    const std::size_t first = gates_.layout().wrench();
    if (now_ == nullptr || i < first) return i;
    return first + 6 * now_->given().sensors[(i - first) / 6] + (i - first) % 6;
  }

  // A sample of a robot that is not, or was not of late, whole.
  Result step(const Sample& sample) {
    events_.begin();
    Deputy* const needed = absent_.any() ? deputies_.without(absent_.all()) : nullptr;
    Deputy* const before = std::exchange(warming_, needed != now_ ? needed : nullptr);
    if (warming_ != nullptr && warming_ != before) {
      warming_->begin(whole_, last_.sample());
      since_ = listens_ = sample.time;
    }
    share_work();
    const Result of_whole = whole_.update(sample);  // it settles anew as soon as all are back
    Result of_now = now_ != nullptr ? now_->update(sample) : of_whole;
    events_.end_those_that_waited();
    if (warming_ != nullptr) {
      const Result of_warming = warming_->update(sample);
      if (!settled(of_warming)) listens_ = sample.time;
      if (settled(of_warming) && is_time(of_now, of_warming)) {
        hand_over(of_now, std::exchange(warming_, nullptr), listens_);
        of_now = of_warming;
      }
    } else if (now_ != nullptr && !absent_.any() && settled(of_whole)) {
      hand_over(of_now, nullptr, sample.time);
      of_now = of_whole;
    }
    listen(sample);
    if (now_ == nullptr) return said_by_whole(of_now);
    // What is wrong with the sample itself, the whole robot tells.
    of_now.health |= (of_whole.health & ~kSettling) | kSensorExcluded;
    return said_by_stand_in(of_now);
  }

  // All that take this sample have as much time as one alone.
  void share_work() {
    int pipelines = 1;
    const auto takes_it = [&](const Deputy& deputy) {
      return &deputy == now_ || &deputy == warming_ || deputy.feels();
    };
    deputies_.visit([&](const Deputy& deputy) { pipelines += takes_it(deputy) ? 1 : 0; });
    whole_.share_work(pipelines);
    deputies_.visit([&](Deputy& deputy) { deputy.pipeline().share_work(pipelines); });
  }

  // Those who spoke before listen until nothing that they felt lasts: they may speak again.
  void listen(const Sample& sample) {
    listening_ = false;
    deputies_.visit([&](Deputy& deputy) {
      if (!deputy.feels() || &deputy == now_ || &deputy == warming_) return;
      deputy.update(sample);
      listening_ = true;
    });
  }

  // Does the one that warms up speak from now on? A lost packet or two are nothing. What was felt before
  // a loss the next one feels a little later: until then nothing says that it is gone.
  bool is_time(const Result& of_now, const Result& of_warming) const {
    if ((of_now.health & kSensorExcluded) == 0) return false;
    const bool feels = !of_warming.contacts.empty(), quiet = of_now.contacts.empty();
    const double lost = of_warming.time - since_, bridge = whole_.observer().bridge(0);
    return (quiet && feels) || (lost > bridge && (quiet || feels)) || lost > tuning().gates.continues;
  }
  static bool settled(const Result& result) { return (result.health & kSettling) == 0; }

  // From now on `to` speaks; null: the whole robot. `last`: what the one before makes of this sample.
  // It has listened since then [s].
  void hand_over(const Result& last, Deputy* to, double since) {
    events_.take(now_, last.events);
    events_.hand_over(std::exchange(now_, to), to, since);
  }

  Result said_by_stand_in(const Result& r) {
    events_.find_continued(now_, r.events);
    Result said = words_.of(*now_, r, events_);
    events_.take(now_, r.events);
    said.events = events_.changes();
    return said;
  }

  Result said_by_whole(const Result& r) {
    events_.take(nullptr, r.events);
    Result said = r;
    if (events_.renumbers()) said.contacts = words_.renumbered(nullptr, r, events_);
    said.events = events_.changes();
    return said;
  }

  Pipeline whole_;
  ChannelGates gates_;
  ParityWatch parity_;
  LeftOut left_out_;
  Deputies deputies_;
  ChannelDoubts doubts_;
  ToldEvents events_;
  WholeWords words_;
  SpokenResets resets_;
  AbsentSensors absent_;  // at the last sample
  KeptSample last_;       // that the whole robot has taken
  double since_ = kUnknown;    // when `warming_` began [s]
  double listens_ = kUnknown;  // since when it has settled [s]
  bool listening_ = false;   // does any that has spoken before?
  std::vector<Fault> sound_, faults_;  // of channels that are all believed; of all that tell, together
  std::vector<double> ratios_;         // (kAhead, channels)
  Deputy *now_ = nullptr, *warming_ = nullptr;  // who speaks, if not the whole; who shall
  std::vector<int> none_;
};

}  // namespace touchline
