// SPDX-License-Identifier: Apache-2.0
// One of the contacts on a segment slides while the others are held. It is located anew in every
// sample, with what is known of the others taken out, from where all of them were known before it
// began to. No allocation per sample.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>

#include "touchline/detail/localizer/known_fit.hpp"
#include "touchline/detail/localizer/reports.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"
#include "touchline/detail/place/single_contact.hpp"

namespace touchline {

class Slides {
 public:
  enum class Outcome { none, slides, rests };

  Slides(SingleContact& single, Measurement& measurement, const LocalizerSettings& settings,
         JointFit& fit, KnownFit& known, Reports& reports)
      : single_(single),
        measurement_(measurement),
        settings_(settings),
        fit_(fit),
        known_(known),
        reports_(reports) {}

  // Has one contact moved along its body, no faster than contacts slide? Of several the one that
  // explains best. Then all are reported, also where a sample says otherwise in between; once it
  // rests they are known from where it does. `left`: units of work, of which it takes what it needs.
  // `undecided`: is it open where one of them is? Then none that is taken for a slider is sure.
  // `report(k)` tells of one that is held.
  template <class Read, class Report>
  Outcome follow(SegmentContacts& s, const SegmentSample& now, int& left, bool undecided, Read&& read,
                 Report&& report) {
    const JointEstimate& before = s.known.before.contacts;
    Slide& slide = s.unexplained.slide;
    const double time = now.time, brief = now.brief(), since = s.unexplained.since;
    const double way = settings_.fastest_slide * (time - since + brief);
    const double passed = 0.5 * now.bandwidth * std::max(0.0, time - slide.weighed);
    slide.weighed = time;
    int slider = -1;
    for (int c = 0; c < before.count; ++c) {
      read();
      if (before.count > 1) {
        before.copy_without(c, others_);
        fit_.take_out(others_, Change::none(), measurement_);
      }
      const double lag = before.count > 1 ? before.known[c].lag : now.lag;
      const Ask ask{Ask::kSlides + c, false, false, left / (before.count - c)};
      const Answer& a = single_.locate(now.segment, lag, measurement_, ask);
      left -= single_.units();
      const bool can = within_reach(before.known[c], a, single_.surfaces(), way, settings_);
      const double never = chi2_limit(measurement_.size(), settings_.slide_never);
      slide.against[c] += passed * (can ? a.chi2 : never);
      if (!can || (slider >= 0 && slide.against[c] > slide.against[slider])) continue;
      slider = c;
      answer_ = a;
    }
    if (slider < 0 && !(slide.seen && time - *slide.seen < brief)) return Outcome::none;
    const bool found = slider >= 0;
    if (found) {
      if (undecided || (!decided(s, slider) && moved(before.known[slider]) > settings_.place_radius))
        answer_.status = Status::ambiguous;
      slide.seen = time;
      slide.place = answer_;
      if (before.count > 1) doubt_if_wide(slide.place, settings_);
    } else {
      slider = *slide.slider;
    }
    for (int i = 0; i < before.count; ++i) {
      if (i != slider) report(before.known[i]);
    }
    reports_.add(before.known[slider].serial, slide.place);
    const bool anew = slide.slider != slider || !slide.rests;
    slide.slider = slider;
    if (!found || answer_.searching) return Outcome::slides;
    read();
    if (before.count == 1) {  // nothing is held: any sample tells where it is
      if (time - since < settings_.young * brief) return Outcome::slides;
      rest(slide.rested = before, slider);
      s.known.contacts = slide.rested;
      return Outcome::rests;
    }
    if (anew || !stays(slide)) {
      slide.rests = time;
      rest(slide.rested = before, slider);
    } else if (time - *slide.rests >= rest_time(s, slider) * brief) {
      read();  // when it came to rest the filter still showed where it was before
      rest(slide.rested = before, slider);
      s.known.contacts = slide.rested;
      return Outcome::rests;
    }
    return Outcome::slides;
  }

 private:
  // Times 1 / K, for which it has to rest.
  double rest_time(const SegmentContacts& s, int slider) const {
    return decided(s, slider) ? settings_.young : settings_.slide_long;
  }

  // Can no other one as well have slid?
  bool decided(const SegmentContacts& s, int slider) const {
    const double* against = s.unexplained.slide.against;
    for (int c = 0; c < s.known.before.contacts.count; ++c) {
      if (c != slider && against[c] < against[slider] + settings_.slide_margin) return false;
    }
    return true;
  }

  // From where a contact was known to where it is found [m].
  double moved(const KnownContact& k) const {
    return norm(answer_.candidates[0].point - single_.surfaces().to_world(k.point, k.node));
  }

  // Does all that is felt say that it is where it was found? A changed force would explain the first
  // millimetres of its going on.
  bool stays(const Slide& slide) {
    fit_.weigh(slide.rested, measurement_);
    return known_.explain(slide.rested) && !known_.moved();
  }

  // Contact c is where it was found now.
  void rest(JointEstimate& contacts, int c) {
    KnownContact& k = contacts.known[c];
    const Unrest unrest = k.unrest;
    k = found_contact(k.serial, answer_, single_.surfaces(), k.age, k.lag);
    k.unrest = unrest;
    contacts.forget(c, settings_);
    fit_.weigh(contacts, measurement_);
    fit_.begin(measurement_, contacts);
    fit_.judge(contacts);
  }

  SingleContact& single_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  JointFit& fit_;
  KnownFit& known_;
  Reports& reports_;
  Answer answer_;
  JointEstimate others_;
};

}  // namespace touchline
