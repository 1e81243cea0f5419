// SPDX-License-Identifier: Apache-2.0
// Two known contacts on one body have come so near to each other that they are one place, and one
// contact explains all that both did: the older goes on, with the force of both. No allocation.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include "touchline/detail/localizer/known_fit.hpp"
#include "touchline/detail/localizer/reports.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"

namespace touchline {

class Merging {
 public:
  Merging(const LinkSurfaces& surfaces, const LocalizerSettings& settings, JointFit& fit,
          KnownFit& known, Reports& reports)
      : surfaces_(surfaces),
        settings_(settings),
        fit_(fit),
        known_(known),
        reports_(reports) {}

  // Takes a sample that known contacts explain; returns whether two have become one, after they
  // were for 1 / K.
  bool follow(SegmentContacts& s, const SegmentSample& now) {
    const JointEstimate& all = s.known.contacts;
    for (int a = 0; a < all.count; ++a) {
      for (int b = a + 1; b < all.count; ++b) {
        if (!near(all.known[a], all.known[b]) || !unite(all, a, b)) continue;
        if (!s.known.met) s.known.met = now.time;
        if (now.time - *s.known.met < now.brief()) return false;
        reports_.end(all.known[b].serial);
        fit_.accept(one_, Change::none(), 1.0);
        s.known.contacts = one_;
        s.known.met.reset();
        s.know(now);
        return true;
      }
    }
    s.known.met.reset();
    return false;
  }

 private:
  bool near(const KnownContact& a, const KnownContact& b) const {
    return a.node == b.node && norm(a.point - b.point) < settings_.place_radius;
  }

  // Does one contact between two, in place of both, explain the measurement?
  bool unite(const JointEstimate& all, int a, int b) {
    one_ = all;
    KnownContact& k = one_.known[a];
    const KnownContact& gone = all.known[b];
    const double size = norm(k.force), other = norm(gone.force);
    const double share = other / std::max(size + other, 1e-9);
    const SurfacePoint p = surfaces_[k.surface].mesh.nearest_to_point(
        k.point + share * (gone.point - k.point), settings_.place_radius);
    if (p.face < 0) return false;
    one_.move(a, p);
    k.force = k.force + gone.force;
    one_.forget(a, settings_);
    one_.remove(b);
    return known_.explain_calmly(one_);
  }

  const LinkSurfaces& surfaces_;
  const LocalizerSettings& settings_;
  JointFit& fit_;
  KnownFit& known_;
  Reports& reports_;
  JointEstimate one_;
};

}  // namespace touchline
