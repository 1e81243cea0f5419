// SPDX-License-Identifier: Apache-2.0
// The contacts on one segment over time. Contacts rarely begin at the same instant: as long as the
// known ones, with their forces free, explain what is measured, nothing has begun. When they no
// longer do, what is left without them is a single contact again. No allocation per sample.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "touchline/detail/localizer/arrivals.hpp"
#include "touchline/detail/localizer/known_fit.hpp"
#include "touchline/detail/localizer/merging.hpp"
#include "touchline/detail/localizer/reports.hpp"
#include "touchline/detail/localizer/rival_places.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"
#include "touchline/detail/localizer/twins.hpp"
#include "touchline/detail/localizer/work_share.hpp"
#include "touchline/detail/place/lone_channel.hpp"
#include "touchline/detail/place/past.hpp"
#include "touchline/detail/place/single_contact.hpp"

namespace touchline {

class Tracks {
 public:
  Tracks(SingleContact& single, Measurement& measurement, const LocalizerSettings& settings,
         std::size_t rows, int segments, double period, const Observer& observer)
      : single_(single),
        measurement_(measurement),
        settings_(settings),
        lone_(observer, measurement),
        fit_(measurement.posture(), single.surfaces(), settings, rows),
        known_(measurement, fit_, settings),
        reports_(single.surfaces()),
        pasts_(segments, Past(measurement.posture().nodes().size(), settings.past_worn)),
        looked_(segments),
        rivals_(segments, RivalPlaces(single.surfaces(), settings, rows)),
        share_(settings.sample_work(period)),
        arrivals_(single, measurement, settings, fit_, known_, reports_, lone_, rivals_, period),
        merging_(single.surfaces(), settings, fit_, known_, reports_),
        twins_(single.surfaces(), measurement, settings, fit_, known_, reports_, rows, segments,
               period) {}

  // One sample of segment g: fills the reports. `read()` takes the measurement anew.
  template <class Read>
  void follow(SegmentContacts& s, int g, double bandwidth, double time, Read&& read_all) {
    follow_contacts(s, g, bandwidth, time, read_all);
    if (suspect_.any() || settings_.first_entry || !measurement_.has_wrench()) return;
    if (time - looked_[g].time < kLook || s.state.is(Tracking::suspected)) return;
    if (!read_all()) return;
    suspect_ = look_again(g);
    suspect_.touched = s.state.is(Tracking::single);
    lone_.take_out(g, time);
  }

  // A channel that would show alone what is felt in the last sample, or what the known contacts leave.
  const Suspect& suspect() const { return suspect_; }
  // From now on until then [s] a channel tells nothing.
  void leave_out(int channel, double until) { lone_.leave_out(channel, until); }

  // From the next sample on so many pipelines take each: they share its work.
  void share_work(int pipelines) { share_.divide(pipelines); }

  // Segment g is touched anew.
  int begin(int g) {
    pasts_[g].restart();
    rivals_[g].drop();
    single_.forget(g);
    return reports_.next();
  }

  // What is said after the last sample.
  const Reports& reports() const { return reports_; }

  // Has a place been searched for in the last sample?
  bool searched() const { return share_.searched(); }

  // Gives each body the probability that the evidence for links gives it, where one contact stands for
  // all that joint torques show.
  bool share_out(const std::vector<BodyShare>& shares) {
    if (measurement_.can_be_followed() || settings_.first_entry || reports_.count() != 1) return false;
    Answer& answer = reports_.answer(0);
    if (!placed(answer)) return false;
    single_.share_out(shares, measurement_, answer);
    return true;
  }

 private:
  // When a channel was looked for again [s], and the squared size of what was felt then.
  struct Look {
    double time = -kAbsurd, size = 0.0;
  };
  static constexpr double kLook = 0.005;  // [s] between second looks: a suspect lasts four of them
  // What known contacts explain takes so many units of a sample's work, and each but the first so many
  // more. Such a part is left at least for what arrives beside them. Where a pair is looked for one
  // contact has such a part.
  static constexpr int kKnown = 500, kEachKnown = 80, kLeast = 6, kBesidePair = 3;

  void report(int serial, const Answer& answer) { reports_.add(serial, answer); }
  void report(const KnownContact& k) { reports_.add(k); }
  void report_one_of_several(const KnownContact& k, double doubt) {
    report(k);
    reports_.doubt_last_if_wide(settings_, doubt);
  }
  void end(int serial) { reports_.end(serial); }

  template <class Read>
  void follow_contacts(SegmentContacts& s, int g, double bandwidth, double time, Read&& read_all) {
    const auto read = [&] { return read_all() && lone_.take_out(g, time); };
    reports_.clear();
    suspect_ = {};
    now_ = {g, bandwidth, time, 0.0};
    bool told = read_all();
    if (told && s.known.contacts.count == 0 && !settings_.first_entry) suspect_ = lone_.find(g);
    if (told && !suspect_.any()) told = lone_.take_out(g, time);
    if (!told) {
      const JointEstimate& known = s.known.contacts;
      report(known.count > 0 ? known.known[0].serial : s.touched.first, single_.clear());
      return;
    }
    const bool first = !s.touched.searched;
    own_ = share_.take(time, first);
    spent_ = 0;
    const bool waits = first && !share_.begin();
    if (!measurement_.can_be_followed() || settings_.first_entry) {
      if (waits) return report(s.touched.first, single_.wait(measurement_));
      const Ask ask{Ask::kSole, again(s), true, own_};
      report(s.touched.first, single_.locate(g, 0.0, measurement_, ask));
      share_.spend(single_.units());
      return;
    }
    now_.lag =
        s.touched.age.follow(measurement_.load(), bandwidth, time, settings_.oldest) / bandwidth;
    if (measurement_.has_wrench())
      pasts_[g].follow(measurement_.load(), bandwidth, time, measurement_.posture());
    if (!s.unexplained_now() || s.known.contacts.count > 1)
      s.known.contacts.age(bandwidth, time, settings_);
    if (waits) return report(s.touched.first, single_.wait(measurement_));
    go_on(s, read);
    share_.spend(spent_);
  }

  template <class Read>
  void go_on(SegmentContacts& s, Read&& read) {
    switch (s.state.now()) {
      case Tracking::quiet: return;
      case Tracking::suspected:
      case Tracking::pair: return suspected(s);
      case Tracking::single: return single(s, read);
      case Tracking::several: return several(s, read);
      case Tracking::newcomer:
      case Tracking::sliding:
      case Tracking::ending: return arrive(s, read);
    }
  }

  // Is all that is felt, after all, one channel's?
  Suspect look_again(int g) {
    const Suspect alone = lone_.find(g);
    const Look before = std::exchange(looked_[g], Look{now_.time, lone_.size()});
    const double passed = now_.time - before.time;
    // What falls as fast as the filter forgets is let go: the shares of several do not fall alike.
    if (lone_.size() < std::exp(-now_.bandwidth * passed) * before.size) return {};
    return alone;
  }

  // Units of work that are left beside what the known contacts take.
  int beside(const SegmentContacts& s) const {
    const int left = own_ - spent_ - kKnown - kEachKnown * (s.known.contacts.count - 1);
    return std::max(left, own_ / kLeast);
  }

  template <class Read>
  void arrive(SegmentContacts& s, Read&& read) {
    const bool first = s.unexplained.since == now_.time;
    const int most = first ? own_ / kLeast : beside(s);
    spent_ += most - arrivals_.follow(s, now_, most, read);
    suspect_ = arrivals_.suspect();
  }

  // The segment's contact, if it has only one.
  const Answer& locate(SegmentContacts& s) {
    const Past& past = pasts_[now_.segment];
    const int units = own_ / (s.state.is(Tracking::pair) ? kBesidePair : 1);
    const Ask ask{Ask::kSole, again(s), false, units};
    const Answer& a = past.known() ? single_.locate(now_.segment, past, measurement_, ask)
                                   : single_.locate(now_.segment, now_.lag, measurement_, ask);
    spent_ += single_.units();
    return a;
  }

  // --- none is known yet: suspected, pair ---
  void suspected(SegmentContacts& s) {
    const Answer& a = locate(s);
    suspect_.touched = placed(a);
    if (may_be_one_channel(s, a)) {
      reports_.add_doubted(s.touched.first, a);
      if (s.state.is(Tracking::pair)) twins_.forget(s);
      s.suspected.explained.reset();
      return;
    }
    if (a.status == Status::not_separable) {
      spent_ += twins_.follow(s, a, now_, own_, spent_, share_);
      return;
    }
    report(s.touched.first, a);
    if (!placed(a)) {
      s.suspected.explained.reset();
      return;
    }
    if (s.state.is(Tracking::pair)) twins_.forget(s);
    if (!s.suspected.explained) {
      s.suspected.explained = now_.time;
    } else if (!a.searching &&
               now_.time - *s.suspected.explained >= settings_.young * now_.brief()) {
      settle(s, a);
    }
  }

  // --- one is known ---
  template <class Read>
  void single(SegmentContacts& s, Read&& read) {
    const Answer& a = locate(s);
    const KnownContact& known = s.known.contacts.known[0];
    if (agrees(known, a, single_.surfaces(), settings_)) {
      report(known.serial, a);
      if (now_.time - s.known.updated < settings_.refit * now_.brief()) return;
      s.creep(now_, settings_);
      if (explains(s.known.contacts)) accept(s);
      return;
    }
    if (explains(s.known.contacts)) {  // where no single force does, now and then, that is noise
      a.status == Status::not_separable ? report(known) : report(known.serial, a);
      return;
    }
    arrivals_.begin(s, now_);
    read();
    arrive(s, read);
  }

  // Is all that is felt, or was it of late, what one faulty channel would show? Then it takes a contact
  // that is found for a while to say that there is one after all, or one more: that is another event,
  // unless the doubt was as short as noise is. Where a contact explained all the while, it is the same.
  bool may_be_one_channel(SegmentContacts& s, const Answer& a) {
    std::optional<Suspected::Doubt>& doubt = s.suspected.one_channel;
    if (suspect_.any() || (doubt && !placed(a))) {
      if (!doubt) doubt = Suspected::Doubt{now_.time, now_.time};
      doubt->last = now_.time;
      doubt->touched = doubt->touched && placed(a);
    }
    if (!doubt) return false;
    if (now_.time - doubt->last < now_.brief()) return true;
    const bool lasted = doubt->last - doubt->since >= now_.brief();
    const bool same = doubt->touched;
    doubt.reset();
    if (!lasted || same) return false;
    reports_.end(s.touched.first);
    s.touched.first = reports_.next();
    return false;
  }

  // Was the contact looked for a moment ago? Filtered noise does not change much in the meantime.
  bool again(SegmentContacts& s) const {
    const int known = s.known.contacts.count;
    const auto& before = s.touched.searched;
    const double pause = settings_.look * now_.brief();
    if (before && before->known == known && now_.time - before->time < pause) return true;
    s.touched.searched = Touched::Search{now_.time, known};
    return false;
  }

  // Does a sole contact explain all, with its force free?
  bool explains(const JointEstimate& one) {
    const Past& past = pasts_[now_.segment];
    const int node = one.known[0].node;
    return past.known() ? known_.explain_alone(one, measurement_.quadratic(node), past.mean(node))
                        : known_.explain_freely(one);
  }

  // The first contact has become known.
  void settle(SegmentContacts& s, const Answer& a) {
    JointEstimate& known = s.known.contacts;
    known.count = 0;
    known.add(found_contact(s.touched.first, a, single_.surfaces(), s.touched.age, now_.brief()),
              settings_);
    if (explains(known)) fit_.judge(known);
    s.know(now_);
    s.state.enter(Tracking::single);
  }

  // Takes the last explanation over, and keeps what was known for when something arrives.
  void accept(SegmentContacts& s) {
    Known& known = s.known;
    const double passed = std::max(0.0, std::min(now_.time - known.updated, now_.brief()));
    if (passed > 0.0) known.updated = now_.time;
    const double independence = 0.5 * now_.bandwidth * passed;
    fit_.accept(known.contacts, known_.change(), independence);
    known.contacts.watch(now_.time, now_.bandwidth, settings_);
    const bool risen = known.contacts.coming(now_.bandwidth) < settings_.risen_note;
    s.refer(now_.time, (risen ? settings_.lasting : settings_.refit) * now_.brief());
  }

  // Learns nothing of a sample, and notes nothing: a contact may have begun to slide.
  void pass(SegmentContacts& s) const { s.known.updated = std::max(s.known.updated, now_.time); }

  // --- several are known ---
  template <class Read>
  void several(SegmentContacts& s, Read&& read) {
    s.creep(now_, settings_);
    JointEstimate& known = s.known.contacts;
    fit_.weigh(known, measurement_);
    if (!known_.explain(known)) {
      arrivals_.begin(s, now_);
      read();
      arrive(s, read);
      return;
    }
    known_.moved() ? pass(s) : accept(s);
    merging_.follow(s, now_);
    KnownContact newcomer;
    RivalPlaces& rivals = rivals_[now_.segment];
    if (rivals.any())
      spent_ += rivals.follow(s.known, now_, measurement_, fit_, known_.change(), beside(s), newcomer);
    const double doubt = known.unrest_doubt(now_.bandwidth, settings_);
    for (const KnownContact* k = known.known; k != known.known + known.count; ++k)
      report_one_of_several(k->serial == newcomer.serial ? newcomer : *k, doubt);
    if (rivals.searching()) reports_.search_last();  // the newcomer was added last
    release(s);
    s.enter_known();
  }

  // Contacts without force have gone; the last one stays until the segment is quiet.
  void release(SegmentContacts& s) {
    JointEstimate& known = s.known.contacts;
    for (int c = known.count - 1; c >= 0 && known.count > 1; --c) {
      KnownContact& k = known.known[c];
      const double sigma = known.force_sigma(c);
      const double least = std::max(settings_.least_force, settings_.gone_sigmas * sigma);
      const bool gone = norm(k.force) < least && sigma < settings_.least_force;
      if (!gone) k.gone.reset();
      if (gone && !k.gone) k.gone = now_.time;
      if (!gone || now_.time - *k.gone < now_.brief()) continue;
      end(k.serial);
      known.remove(c);
      s.forget_references();
    }
  }

  SingleContact& single_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  LoneChannel lone_;
  Suspect suspect_;
  JointFit fit_;
  KnownFit known_;
  Reports reports_;
  std::vector<Past> pasts_;  // per segment: of its whole wrench
  std::vector<Look> looked_;  // per segment
  std::vector<RivalPlaces> rivals_;  // per segment: of the newcomer admitted last
  // Units of work: of the sample; of the segment at hand, its part and what it has spent of it.
  WorkShare share_;
  int own_ = 0, spent_ = 0;
  Arrivals arrivals_;
  Merging merging_;
  Twins twins_;
  SegmentSample now_;
};

}  // namespace touchline
