// SPDX-License-Identifier: Apache-2.0
// From samples to contacts and events: observer, detection, localization, classification and the
// record of events in one object. One pipeline belongs to one thread at a time. After construction
// neither `update` nor `run` allocates, locks, throws or prints.
#pragma once

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "touchline/detail/classifier/classifier.hpp"
#include "touchline/detail/detector/detector.hpp"
#include "touchline/detail/detector/loadable.hpp"
#include "touchline/detail/events/describe.hpp"
#include "touchline/detail/events/event_recorder.hpp"
#include "touchline/detail/events/period_watch.hpp"
#include "touchline/detail/events/suspicion.hpp"
#include "touchline/detail/gates/suspect_watch.hpp"
#include "touchline/detail/localizer/localizer.hpp"
#include "touchline/detail/observer/observer.hpp"
#include "touchline/detail/observer/reset_watch.hpp"
#include "touchline/detail/observer/rest_meter.hpp"
#include "touchline/result.hpp"
#include "touchline/robot.hpp"
#include "touchline/sample.hpp"
#include "touchline/tuning.hpp"

namespace touchline {

class Pipeline {
 public:
  // Throws std::invalid_argument with what is wrong where the parts of the robot do not fit.
  explicit Pipeline(Robot robot, const Tuning& tuning = {})
      : robot_(checked(std::move(robot))),
        tuning_(tuning),
        observer_(Tree(robot_.nodes, robot_.gravity), robot_.joints, robot_.sensors, tuning_.method,
                  tuning_.discretization, tuning_.observer),
        detector_(observer_, robot_.rows, robot_.detection, tuning_.detector,
                  touchline::loadable(observer_, robot_.rows, robot_.surfaces)),
        localizer_(observer_, robot_.rows, robot_.noise, std::move(robot_.surfaces),
                   localizer_settings(tuning_, robot_.pushes)),
        classifier_(observer_, robot_.blows, tuning_.classifier),
        recorder_(robot_, observer_, localizer_),
        rest_(observer_.row_layout(), tuning_.observer),
        suspects_(robot_, observer_.layout()),
        suspicions_(robot_.segment_names.size()),
        blow_suspicions_(suspicions_.size()),
        resets_(observer_.row_layout()),
        period_(robot_.noise.period, tuning_.events),
        levels_(robot_.segment_names.size(), 0.0),
        watch_(levels_.size(), Watch::blind),
        contacts_(robot_.segment_names.size() * Reports::kMost) {}

  Pipeline(const Pipeline&) = delete;
  Pipeline& operator=(const Pipeline&) = delete;

  // Takes one sample. A bad one is told in `Result::health`. What is returned is valid until the
  // next call.
  Result update(const Sample& sample) { return follow(sample, observer_.step(sample)); }

  // Takes N samples, whose signals stand one after the other in each array, and calls
  // `each(Result)` after each. `rows` has room for N rows of the observer. The numbers are those of
  // `update`, to the last bit, in whatever parts the samples come. Stops after a sample for which
  // `each` returns false, if it returns anything.
  template <class Each>
  void run(std::size_t samples, const double* time, const Sample& first, double* rows, Each&& each) {
    const std::size_t n = robot_.joints.size(), w = 6 * robot_.sensors.size();
    std::size_t i = 0;
    observer_.run(samples, time, first.q, first.qd, first.tau, first.wrench, rows,
                  [&](const double* row) {
                    const Sample sample{time[i], first.q + i * n, first.qd + i * n,
                                        first.tau + i * n, first.wrench + i * w};
                    ++i;
                    return each(follow(sample, row));
                  });
  }

  // Calls `visit(Event)` for each event that lasts, in the order of detection. It takes as long as
  // a few samples; those that have ended were told by the sample that ended them.
  template <class Visit>
  void visit_lasting(Visit&& visit) {
    recorder_.visit_lasting(visit);
  }

  // Events of segment g that have begun at `since` or later are doubted until `until` [s]: a channel
  // that it feels is not what it was. What is doubted is no collision, and its link is not sure. No
  // contact becomes a collision then, however long ago it is.
  void doubt(std::size_t g, double since, double until) {
    suspicions_[g].extend(observer_.time(), since, until);
    blow_suspicions_[g].extend(observer_.time(), since, until);
    classifier_.forget_blows(g, since);
  }
  // The same of the torque of joint j. A blow that shows without it is a collision.
  void doubt_torque(std::size_t g, std::size_t j, double since, double until) {
    suspicions_[g].extend(observer_.time(), since, until);
    if (robot_.blows[g].joints.empty()) return;
    classifier_.leave_out(j, until);
    classifier_.forget_blows(g, since);
  }

  // From the next sample on so many pipelines take each: they share the work that a sample may take.
  void share_work(int pipelines) { localizer_.share_work(pipelines); }

  // What a joint's torque, or a sensor, had last is not believed: with the next sample its estimates
  // begin anew, even where the gap is short.
  void begin_torque_anew(std::size_t j) { observer_.begin_torque_anew(j); }
  void begin_sensor_anew(std::size_t s) { observer_.begin_sensor_anew(s); }

  // The posterior over surfaces of the only contact of the last sample; takes milliseconds and
  // allocates. Throws std::invalid_argument where there are several or none.
  std::vector<SurfaceCell> region() const { return localizer_.region(); }

  // What is felt while the arm is at rest, untouched: the offsets that a tare takes off the biases.
  const RestMeter& rest() const { return rest_; }
  double time() const { return observer_.time(); }  // of the last accepted sample [s]
  // The number of the next event; another pipeline that goes on for this one counts on from it.
  int next_event() const { return recorder_.next_event(); }
  void number_events_from(int next) { recorder_.number_events_from(next); }

  // What stands on a row of the detector while nothing touches [N, Nm], and over how long it has
  // been averaged [s]. `go_on_from` takes what another pipeline has learned of its row `of`.
  double baseline(int row) const { return detector_.baseline(row); }
  double known_for(int row) const { return detector_.known_for(row); }
  // How far a row of the detector has shown that the arm is not as told.
  Standing standing(int row) const { return detector_.standing(row); }
  void go_on_from(const Pipeline& other, int of, int row, double baseline) {
    detector_.go_on_from(other.detector_, of, row, baseline);
  }
  // The estimates go on with those of another pipeline; see `Observer::go_on_from`.
  void go_on_from(const Pipeline& other, const std::vector<int>& sensors,
                  const std::vector<std::vector<int>>& parts) {
    observer_.go_on_from(other.observer_, sensors, parts);
  }
  // In which state the contacts of segment g are, and which transitions there were: for tests.
  const TrackingState& tracking(int g) const { return localizer_.state(g); }
  const Observer& observer() const { return observer_; }
  // Per row of the detector: can a contact load it?
  const std::vector<char>& loadable() const { return detector_.loadable(); }

  // Without its surfaces, which are the localizer's: `surfaces()`.
  const Robot& robot() const { return robot_; }
  const std::vector<LinkSurface>& surfaces() const { return localizer_.surfaces(); }
  const Tuning& tuning() const { return tuning_; }
  const RowLayout& row_layout() const { return observer_.row_layout(); }
  std::size_t rows() const { return robot_.rows.size(); }  // of the detector

 private:
  static LocalizerSettings localizer_settings(const Tuning& tuning, const Pushes& pushes) {
    LocalizerSettings settings;
    static_cast<PlaceTuning&>(settings) = tuning.place;
    static_cast<LocalizerTuning&>(settings) = tuning.localizer;
    settings.first_entry = tuning.first_entry;
    settings.gap_sigmas = tuning.detector.gap_sigmas;
    settings.friction = pushes.friction;
    settings.finger = pushes.reach;
    return settings;
  }

  static Robot checked(Robot robot) {
    check(robot);
    return robot;
  }

  Result follow(const Sample& sample, const double* row) {
    detector_.step(row, sample.q, sample.qd);
    std::copy(detector_.levels().begin(), detector_.levels().end(), levels_.begin());
    classifier_.step(sample.time, row, levels_.data(),
                     [&](std::size_t g) { return blow_suspicions_[g].lasts(sample.time); });
    recorder_.begin();
    suspects_.begin(sample);
    count_ = 0;
    if (touched()) localize(sample, row);
    suspects_.finish(sample.time, [this](int channel, double until) {
      localizer_.leave_out(channel, until);
    });
    for (std::size_t segment = 0; segment < levels_.size(); ++segment) {
      if (!(levels_[segment] > 0.0)) localizer_.rest(static_cast<int>(segment), row, sample.time);
    }
    recorder_.finish();
    period_.take(observer_.time(), observer_.max_gap());
    rest_.take(row, sample.qd, observer_.time(), touched_);
    resets_.step(row, [this](std::size_t i) { return observer_.restarts(i); });
    judge_watch();
    return result(sample, row);
  }

  // Is a segment touched, or was it at the last sample?
  bool touched() {
    const bool before = touched_;
    touched_ = std::any_of(levels_.begin(), levels_.end(), [](double x) { return x > 0.0; });
    return before || touched_;
  }

  void localize(const Sample& sample, const double* row) {
    const Estimate estimate(row, observer_.row_layout());
    const Span<double> normalized{detector_.normalized().data(), detector_.normalized().size()};
    if (touched_) {
      localizer_.set_state(sample.q, sample.qd, detector_.drift().data(),
                           detector_.quiet_of_places().data(), detector_.excess().data(),
                           detector_.wrench_stands_off());
    }
    for (std::size_t segment = 0; segment < levels_.size(); ++segment) {
      const int g = static_cast<int>(segment);
      const bool felt = levels_[segment] > 0.0;
      localizer_.follow(g, felt, row, detector_.placing().data(), sample.time, sample.q);
      const Reports& reports = localizer_.reports();
      if (felt) {
        suspects_.add(localizer_.suspect(), detector_.is_over(g));
        classifier_.consider(g, reports);
        for (int k = 0; k < reports.count(); ++k) {
          Contact& contact = contacts_[count_++];
          const LastingEvent* event = recorder_.of(reports[k].serial);
          const double began = event != nullptr ? event->detected : sample.time;
          const bool unsure = blow_suspicions_[segment].lasts(sample.time);
          const bool no_blow =
              reports[k].doubted || blow_suspicions_[segment].meets(sample.time, began);
          const bool since_begun = suspicions_[segment].meets(sample.time, began);
          const bool doubted = reports[k].doubted || since_begun;
          const bool known = event != nullptr && event->level == ContactLevel::collision;
          const bool later = began > classifier_.blow(g) + tuning_.classifier.decide_within;
          fill(contact, g, k, estimate);
          if (no_blow || later || (unsure && !known)) contact.level = ContactLevel::contact;
          if (!known && classifier_.by_one_joint(g)) ask_place(contact, sample.time);
          const bool own = detector_.is_own_doing(segment);
          const bool may_be_none = doubted || own || detector_.may_be_own_doing(segment);
          contact.event =
              recorder_.add(reports[k].serial, contact, may_be_none, since_begun || own,
                            reports.share(k), sample.time, sample.q, estimate.tau_ext(), normalized);
          if (may_be_none) touchline::doubt(contact);  // the recorder doubts its event by itself
        }
      }
      for (Localizer::Memory* memory : localizer_.ended()) {
        const LastingEvent* event = recorder_.of(memory->serial);
        if (event != nullptr && suspicions_[segment].meets(sample.time, event->detected))
          recorder_.doubt_all_of(memory->serial);
        recorder_.end(*memory, sample.time);
        memory->serial = -1;
      }
    }
  }

  // One joint's torque alone says that a contact is a collision. It may be wrong: the others must have a
  // place at which one force does all of it, as soon as one is found and while the blow is young.
  void ask_place(Contact& contact, double time) const {
    const bool late = time > classifier_.blow(contact.segment) + tuning_.classifier.decide_within;
    if (!late && contact.status != Status::not_separable) return;
    contact.level = ContactLevel::contact;
    contact.decided = contact.decided && late;
  }

  // All of contact k on segment g but its event.
  void fill(Contact& c, int g, int k, const Estimate& estimate) const {
    const Answer& answer = localizer_.reports()[k].answer;
    const Kind kind = classifier_.kind(g, localizer_.reports().share(k));
    describe(answer, g, c);
    c.zone = c.link >= 0 ? robot_.links[c.link].zone : robot_.segment_zones[g];
    c.level = kind == Kind::collision ? ContactLevel::collision : ContactLevel::contact;
    c.decided = kind >= Kind::contact;
    c.clamped = classifier_.clamped(g, k)             ? Clamped::yes
                : c.status == Status::not_separable ? Clamped::unknown
                                                      : Clamped::no;
    c.rate = classifier_.rate(g);
    const bool root = observer_.layout().segments[g].sensor < 0;
    const Span<double> wrench = estimate.segment_wrench(g);
    for (int i = 0; i < 6; ++i) c.wrench[i] = root ? kUnknown : wrench[i];
  }

  // By what is known of the detector's rows.
  void judge_watch() {
    for (std::size_t g = 0, i = 0; g < watch_.size(); ++g) {
      bool any = false, all = true;
      for (; i < robot_.rows.size() && robot_.rows[i].segment == static_cast<int>(g); ++i) {
        const bool known = detector_.sample(i).known;
        any = any || known;
        all = all && known;
      }
      watch_[g] = !any ? Watch::blind : all ? Watch::watched : Watch::degraded;
    }
  }

  Result result(const Sample& sample, const double* row) const {
    const RowLayout& layout = observer_.row_layout();
    const Health health = static_cast<Health>(row[layout.health()]) |
                          (period_.differs() ? kPeriodDiffers : 0) |
                          (recorder_.crowded() ? kNoRoom : 0) |
                          (detector_.stands_off() ? kOffset : 0) | (detector_.noisy() ? kNoisy : 0);
    return {sample.time,
            health,
            Estimate(row, layout),
            view(detector_.levels()),
            view(detector_.normalized()),
            view(detector_.drift()),
            view(detector_.quiet()),
            view(watch_),
            {contacts_.data(), count_},
            view(recorder_.changes()),
            {},
            view(suspects_.told()),
            {},
            view(resets_.resets())};
  }

  template <class T>
  static Span<T> view(const std::vector<T>& values) {
    return {values.data(), values.size()};
  }

  Robot robot_;
  Tuning tuning_;
  Observer observer_;
  Detector detector_;
  Localizer localizer_;
  Classifier classifier_;
  EventRecorder recorder_;
  RestMeter rest_;
  SuspectWatch suspects_;
  std::vector<Suspicion> suspicions_;       // of the segments: of what begins there
  std::vector<Suspicion> blow_suspicions_;  // and of how its force grows
  ResetWatch resets_;
  PeriodWatch period_;
  std::vector<double> levels_;  // of the segments, as the classifier takes them
  std::vector<Watch> watch_;
  std::vector<Contact> contacts_;
  std::size_t count_ = 0;  // of contacts in the last sample
  bool touched_ = false;
};

}  // namespace touchline
