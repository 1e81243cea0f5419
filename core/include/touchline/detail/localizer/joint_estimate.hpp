// SPDX-License-Identifier: Apache-2.0
// The contacts on one segment whose places are known, and the joint covariance of all their forces
// and places: where the wrench alone tells two contacts, what one gains the other loses.
// Theory: docs/theory.md, sections 6.1 and 6.2.
#pragma once

#include <algorithm>
#include <cmath>

#include "touchline/detail/localizer/known_contact.hpp"
#include "touchline/detail/localizer/settings.hpp"
#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

struct JointEstimate {
  static constexpr int kMost = 4, kEach = 5;  // contacts; unknowns of each: force, place
  static constexpr int kSize = kEach * kMost;
  int count = 0;
  KnownContact known[kMost];
  double covariance[kSize * kSize] = {};  // (size, size), row by row

  int size() const { return kEach * count; }

  // A contact of which nothing is known but roughly its place and force.
  void add(const KnownContact& contact, const LocalizerSettings& t) {
    const int old = size(), n = old + kEach;
    for (int i = old - 1; i >= 0; --i) {
      for (int j = old - 1; j >= 0; --j) covariance[i * n + j] = covariance[i * old + j];
    }
    known[count++] = contact;
    forget(count - 1, t);
  }

  void remove(int c) {
    const int n = size(), first = kEach * c, after = first + kEach;
    int to = 0;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) {
        if ((i < first || i >= after) && (j < first || j >= after))
          covariance[to++] = covariance[i * n + j];
      }
    }
    std::copy(known + c + 1, known + count, known + c);
    --count;
  }

  // Forgets all that is known of a contact.
  void forget(int c, const LocalizerSettings& t) {
    const int n = size(), first = kEach * c;
    part(first, kEach);
    for (int i = first; i < first + kEach; ++i) {
      std::fill_n(covariance + i * n + first, kEach, 0.0);
      covariance[i * (n + 1)] = i < first + 3 ? t.force_scale * t.force_scale : t.anywhere;
    }
  }

  // Those of all contacts but one.
  void copy_without(int c, JointEstimate& out) const {
    out = *this;
    out.remove(c);
  }

  // How old that is which each force speaks of, at a time [s].
  void age(double bandwidth, double time, const LocalizerTuning& t) {
    for (int c = 0; c < count; ++c) {
      KnownContact& k = known[c];
      k.lag = k.age.follow(k.force, bandwidth, time, t.oldest) / bandwidth;
    }
  }

  // What forces that are held and places that are kept do in a time [s]. A force of which the filter
  // does not show all yet will go on to change: along its own direction, and about as foreseen. Unrest grows by `lasts` times what it does from
  // look to look.
  void creep(double passed, double bandwidth, const LocalizerTuning& t, double lasts) {
    const int n = size();
    for (int c = 0; c < count; ++c) {
      KnownContact& k = known[c];
      const double coming = k.coming(bandwidth), growth = 2.0 * bandwidth * coming * coming;
      const double walk = t.tremor + lasts * k.unrest.rate();
      const Vec3 u = (1.0 / std::max(norm(k.force), 1e-9)) * k.force;
      k.force = k.force + k.foreseen(passed, bandwidth);
      double* P = covariance + kEach * c * (n + 1);
      for (int i = 0; i < kEach; ++i)
        P[i * (n + 1)] += passed * (i < 3 ? walk + t.doubt_across * growth : t.place_creep);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j)
          P[i * n + j] += passed * (t.doubt - t.doubt_across) * growth *
                          component(u, i) * component(u, j);
      }
    }
  }

  // Sees how the forces change, as they are known at a time [s].
  void watch(double time, double bandwidth, const LocalizerTuning& t) {
    for (int c = 0; c < count; ++c) {
      KnownContact& k = known[c];
      if (count > 1) {
        k.unrest.conclude(time, bandwidth, t);
        continue;
      }
      const double sigma = force_sigma(c), coming = k.coming(bandwidth);
      const double doubt = 2.0 * (t.doubt + 2.0 * t.doubt_across) * coming * coming;
      k.unrest.follow(k.force, sigma * sigma, k.foreseen(1.0 / bandwidth, bandwidth), doubt, time,
                      bandwidth, t);
    }
  }

  // The largest part of a force that the filter does not show yet.
  double coming(double bandwidth) const {
    double most = 0.0;
    for (int c = 0; c < count; ++c)
      most = std::max(most, known[c].coming(bandwidth) / std::max(norm(known[c].force), 1e-9));
    return most;
  }

  // The most restless of the hands: what another may be like.
  double unrest() const {
    double most = 0.0;
    for (int c = 0; c < count; ++c) most = std::max(most, known[c].unrest.rate());
    return most;
  }

  // The places' own covariances, from the joint one; none is sharper than surfaces are, or than the
  // errors allow that the samples have in common.
  void spread(const LocalizerTuning& t) {
    const int n = size();
    for (int c = 0; c < count; ++c) {
      double* P = covariance + (kEach * c + 3) * (n + 1);
      P[0] = std::max(P[0], t.sharpest);
      P[n + 1] = std::max(P[n + 1], t.sharpest);
      const Spread seen{P[0], P[1], P[n + 1]}, lasting = known[c].lasting;
      const double rest = std::max(0.0, lasting.trace() - seen.trace());
      known[c].place = rest > 0.0 ? seen + (rest / lasting.trace()) * lasting : seen;
    }
  }

  // How many times as large the unrest of any may be.
  double unrest_doubt(double bandwidth, const LocalizerTuning& t) const {
    double most = 1.0;
    for (int c = 0; c < count; ++c) most = std::max(most, known[c].unrest.doubt(bandwidth, t));
    return most;
  }

  // Standard deviation of a force in its worst direction at most [N].
  double force_sigma(int c) const {
    const int n = size();
    double sum = 0.0;
    for (int i = kEach * c; i < kEach * c + 3; ++i) sum += covariance[i * (n + 1)];
    return std::sqrt(sum);
  }

  // Cosine of 25 degrees. Larger: each face of a mesh that a place creeps over tells of it what is not
  // so. Smaller: curved links are taken for flat.
  static constexpr double kOnePlane = 0.906;
  static constexpr double kEitherSide = 4.0;  // variances within which a place may be on either face

  // Moves the place of a contact along its surface, to `p`. The tangents stay on faces that are nearly
  // normal to them, and for as long as it may be on the face before: what is known of forces and places
  // together lies in one plane. In another one it would contradict the next samples, and the place
  // would seem to be known. So what they share is forgotten there.
  void follow(int c, const SurfacePoint& p) {
    KnownContact& k = known[c];
    const bool alike = dot(p.normal, k.normal) > kOnePlane;
    if (alike) k.alike = p.point;
    const Vec3 beyond = p.point - k.alike;
    if (alike || dot(beyond, beyond) < kEitherSide * k.place.trace()) {
      k.point = p.point;
      return;
    }
    move(c, p);
    k.alike = p.point;
    part(kEach * c + 3, 2);
  }

  // Moves the place of a contact to `p`, whose tangents are turned with the normal, the shortest
  // way: its coordinates along the surface turn with them.
  void move(int c, const SurfacePoint& p) {
    KnownContact& k = known[c];
    Vec3 from[2], to[2];
    tangents(k.normal, from[0], from[1]);
    tangents(p.normal, to[0], to[1]);
    double turn[2][2];
    for (int j = 0; j < 2; ++j) {
      const Vec3 carried = turned(from[j], k.normal, p.normal);
      for (int i = 0; i < 2; ++i) turn[i][j] = dot(to[i], carried);
    }
    k.point = p.point;
    k.normal = p.normal;
    const int n = size(), at = kEach * c + 3;
    for (int i = 0; i < n; ++i) turn_pair(turn, covariance + i * n + at, 1);
    for (int i = 0; i < n; ++i) turn_pair(turn, covariance + at * n + i, n);
  }

 private:
  // Forgets what `count` unknowns share with all others.
  void part(int first, int count) {
    const int n = size();
    for (int i = first; i < first + count; ++i) {
      for (int j = 0; j < n; ++j) {
        if (j < first || j >= first + count) covariance[i * n + j] = covariance[j * n + i] = 0.0;
      }
    }
  }

  // `v` by the shortest turn that takes one unit vector to another (Rodrigues).
  static Vec3 turned(const Vec3& v, const Vec3& from, const Vec3& to) {
    const Vec3 w = cross(from, to);
    const double cosine = dot(from, to);
    if (cosine < -0.999) return v;
    return v + cross(w, v) + (1.0 / (1.0 + cosine)) * cross(w, cross(w, v));
  }

  static void turn_pair(const double turn[2][2], double* x, int stride) {
    const double a = x[0], b = x[stride];
    x[0] = turn[0][0] * a + turn[0][1] * b;
    x[stride] = turn[1][0] * a + turn[1][1] * b;
  }
};

}  // namespace touchline
