// SPDX-License-Identifier: Apache-2.0
// What is said of the contacts on one segment after a sample, each under its number.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <cmath>

#include "touchline/detail/localizer/known_contact.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"

namespace touchline {

// What is said of one contact, under its number. `doubted`: one faulty channel would show the same.
struct Report {
  int serial = -1;
  Answer answer;
  bool doubted = false;
};

class Reports {
 public:
  static constexpr int kMost = SegmentContacts::kMost + 1;

  explicit Reports(const LinkSurfaces& surfaces) : surfaces_(surfaces) {}

  void clear() { count_ = ended_ = 0; }
  // Those beyond the most are left out.
  void add(int serial, const Answer& answer) {
    if (count_ == kMost) return;
    reports_[count_].serial = serial;
    reports_[count_].doubted = false;
    reports_[count_++].answer = answer;
  }
  void add_doubted(int serial, const Answer& answer) {
    if (count_ == kMost) return;
    add(serial, answer);
    reports_[count_ - 1].doubted = true;
  }
  void add(const KnownContact& k) {
    if (count_ == kMost) return;
    reports_[count_].serial = k.serial;
    reports_[count_].doubted = false;
    report(k, surfaces_, reports_[count_++].answer);
  }
  Answer& answer(int i) { return reports_[i].answer; }
  void doubt_last() { reports_[count_ - 1].answer.status = Status::ambiguous; }
  // The place of the last one is still searched for.
  void search_last() {
    Answer& answer = reports_[count_ - 1].answer;
    answer.searching = true;
    if (answer.status == Status::located) answer.status = Status::ambiguous;
  }
  void doubt_last_if_wide(const LocalizerSettings& settings, double doubt = 1.0) {
    doubt_if_wide(reports_[count_ - 1].answer, settings, doubt);
  }
  void change_force(int i, const Vec3& force) {
    reports_[i].answer.force = reports_[i].answer.candidates[0].fit.force = force;
  }
  void end(int serial) {
    if (serial >= 0 && ended_ < kMost) endings_[ended_++] = serial;
  }

  int count() const { return count_; }
  const Report& operator[](int i) const { return reports_[i]; }
  // How much of the load on the segment each carries; 1 for the only one.
  double share(int i) const {
    double sum = 0.0;
    for (int k = 0; k < count_; ++k) sum += size(k);
    return count_ > 1 && sum > 0.0 ? size(i) / sum : 1.0;
  }
  // Numbers of contacts that have ended with this sample.
  int ended() const { return ended_; }
  int ended(int i) const { return endings_[i]; }
  // A number that no contact has had.
  int next() { return serial_++; }

 private:
  double size(int i) const {
    const double force = norm(reports_[i].answer.force);
    return std::isfinite(force) ? force : 0.0;
  }

  const LinkSurfaces& surfaces_;
  Report reports_[kMost];
  int endings_[kMost];
  int count_ = 0, ended_ = 0, serial_ = 0;
};

}  // namespace touchline
