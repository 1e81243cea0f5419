// SPDX-License-Identifier: Apache-2.0
// The explanations of one contact on a segment: all entries of the line of force action into all
// its links, or the nearest surface where the line misses. Where there is no line they are sampled
// points, improved on the mesh. What a sample has no work left for, the next ones do. No allocation per
// sample.
// Theory: docs/theory.md, section 5.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/detail/place/hypothesis.hpp"
#include "touchline/detail/place/few_candidates.hpp"
#include "touchline/detail/place/measurement.hpp"
#include "touchline/detail/place/place_metric.hpp"
#include "touchline/detail/place/refinement.hpp"
#include "touchline/detail/place/view.hpp"

namespace touchline {

// What is asked of a search.
struct Ask {
  static constexpr int kAll = std::numeric_limits<int>::max();
  // What for: a search that is cut short goes on from where the last one for the same purpose has come.
  // For the sole contact of a segment, for one more beside the known ones, the same where their forces
  // are free, and for where each known one has slid.
  static constexpr int kSole = 0, kRemainder = 1, kFreed = 2, kSlides = 3, kCourses = 7;

  int course = kSole;
  bool again = false;  // does what was found by a search a moment ago serve once more?
  bool whole = false;  // is all that comes nearest found also where no point of any body can explain?
  int units = kAll;    // of work (`PlaceTuning::search_work`)
};

class Explanations {
 public:
  Explanations(const Observer& observer, const Posture& posture,
               const PlaceSettings& settings, std::vector<LinkSurface> surfaces)
      : posture_(posture),
        settings_(settings),
        fitter_(settings),
        surfaces_(observer, posture_, std::move(surfaces)),
        refinement_(surfaces_, fitter_) {
    std::size_t most = 0;
    for (int g = 0; g < observer.row_layout().segments; ++g)
      most = std::max(most, surfaces_.bodies(g).size());
    views_.resize(most);
    for (int g = 0; g < observer.row_layout().segments; ++g) {
      for (int c = 0; c < Ask::kCourses; ++c)
        courses_.emplace_back(surfaces_.bodies(g).size(), surfaces_.all().size());
    }
    turns_.resize(most);
    candidates_.resize(kMost);
    missed_.resize(surfaces_.all().size(), -1);
  }

  Explanations(const Explanations&) = delete;
  Explanations& operator=(const Explanations&) = delete;

  // Searches on segment g begin anew.
  void forget(int g) {
    for (int c = 0; c < Ask::kCourses; ++c) courses_[g * Ask::kCourses + c].forget();
  }

  // Finds what may explain segment g; `measurement` has read it. `mean(node)`: where a body was when
  // it felt what the wrench speaks of, and `doubt`: what is not known of that.
  template <class MeanOf>
  void find(int g, MeanOf&& mean, const Doubt& doubt, Measurement& measurement, const Ask& ask) {
    count_ = used_ = units_ = 0;
    all_ = left_ = ask.units;
    complete_ = true;
    course_ = &courses_[g * Ask::kCourses + ask.course];
    best_ = std::numeric_limits<double>::infinity();
    for (const Body& body : surfaces_.bodies(g)) {
      View& view = views_[used_];
      view = View{};
      view.body = used_++;
      view.node = body.node;
      view.surfaces = &body.surfaces;
      view.q = measurement.quadratic(body.node);
      if (measurement.has_wrench()) {
        const double* w = measurement.wrench();
        view.allow_for_motion(posture_.pose(body.node), mean(body.node),
                              norm(Vec3{w[0], w[1], w[2]}), doubt);
      }
      view.begin();
    }
    if (measurement.has_wrench()) {
      std::sort(views_.begin(), views_.begin() + used_,
                [](const View& a, const View& b) { return a.least < b.least; });
    }
    if (!ask.whole && !possible(measurement.size())) {
      if (!ask.again) course_->forget();
      return;
    }
    for (int i = 0; i < used_; ++i) {
      View& view = views_[i];
      if (!(view.least < best_ + settings_.cost_window)) continue;
      if (view.line && !view.found) view.find_line();
      if (view.line && view.floor < best_ + settings_.cost_window) enter(view);
    }
    search(ask, measurement.has_wrench());
  }

  // Has all been looked at once, in this sample or in the last ones, that may explain?
  bool complete() const { return complete_; }
  int units() const { return units_; }  // of work that the search took

  int count() const { return count_; }
  const Candidate* begin() const { return candidates_.data(); }
  const Candidate* end() const { return candidates_.data() + count_; }
  Candidate* begin() { return candidates_.data(); }
  Candidate* end() { return candidates_.data() + count_; }
  double best() const { return best_; }
  // The bodies that were looked at.
  int views() const { return used_; }
  const View& view(int i) const { return views_[i]; }
  const View& view(const Candidate& k) const { return views_[k.view]; }
  const LinkSurfaces& surfaces() const { return surfaces_; }
  const ForceFitter& fitter() const { return fitter_; }

  // Calls `visit(surface, point, normal, t)` for each entry of a line into the links of segment g.
  template <class Visit>
  void entries(int g, const ForceLine& line, Visit&& visit) const {
    for (const Body& body : surfaces_.bodies(g)) {
      for (int s : body.surfaces) surfaces_.entries(s, line, visit);
    }
  }

 private:
  // Room: for candidates, for starts on a surface, for faces beside a line.
  static constexpr int kMost = 192, kStarts = 3, kPassed = 4;
  static constexpr int kSome = 150;   // units of work on a point beside the line: some ten trials
  static constexpr int kNearest = 2;  // units of work: a box beside a line takes as long as so many others
  static constexpr int kTried = 3;    // units of work: a point that is tried, without looking for it
  static constexpr double kRounding = 1e-9;  // a part of costs and weights, far above what they err by

  // Can any point explain, by the bounds that each body sets: the misfit of the best wrench at all,
  // and of the best one of a pure force?
  bool possible(int rows) {
    const double limit = chi2_limit(std::max(1, rows - 5), settings_.pitch_limit);
    for (int i = 0; i < used_; ++i) {
      View& view = views_[i];
      if (!(view.least < limit)) continue;
      if (!view.line) return true;
      view.find_line();
      if (view.floor < limit && std::fabs(view.pitch) < settings_.pitch_limit) return true;
    }
    return false;
  }

  // A point that a search has ended at, in the frame of its node.
  struct Start {
    int surface = -1;
    Vec3 point{}, normal{};
    bool waits = false;  // has it yet to be improved?
    bool spread = false;  // was it found among points that are spread over the body?
    bool fresh = false;   // has a search ended there in this sample?
    bool moved = false;  // has it been, in this sample, and where to?
    Vec3 next_point{}, next_normal{};
  };

  // A look at the faces of a body that is not at its end; body -1: there is none. Which of its surfaces
  // is at hand, and how far into it; the best so far, in the frame of the node.
  struct Look {
    int body = -1, surface = 0, count = 0;
    Mesh::Walk walk;
    Start best[kPassed];
  };

  // The same of the points spread over a body: which of a surface's is next, and how many of its best few
  // have been improved.
  struct SpreadLook {
    int body = -1, surface = 0, sample = 0, count = 0, improved = 0;
    Start best[kStarts];
  };

  // What is left of earlier searches for one purpose.
  struct Course {
    Course(std::size_t bodies, std::size_t surfaces) : due(bodies, 0), missed(surfaces) {
      starts.reserve(kMost);
      forget();
    }
    void forget() {
      starts.clear();
      std::fill(due.begin(), due.end(), 0);
      look.body = spread.body = -1;
      for (Start& start : missed) start.surface = -1;
      complete = false;
    }
    bool waits() const {
      return std::any_of(starts.begin(), starts.end(), [](const Start& s) { return s.waits; });
    }
    bool cut() const {
      return waits() || std::any_of(due.begin(), due.end(), [](char d) { return d != 0; });
    }
    // Starts are where they have been improved to.
    void move_on() {
      for (Start& s : starts) {
        if (!s.moved) continue;
        s.point = s.next_point;
        s.normal = s.next_normal;
      }
    }

    std::vector<Start> starts;
    std::vector<char> due;      // per body: has it yet to be searched?
    Look look;
    SpreadLook spread;
    std::vector<Start> missed;  // per surface that a line misses: the best point; surface -1: not known
    bool complete = false;      // has all been looked at once, that may explain?
  };

  // What must be searched for costs more, so it comes last and only where it may matter. What had to
  // wait in the last sample comes first.
  void search(const Ask& ask, bool has_wrench) {
    const bool was_cut = course_->cut();
    waited_ = course_->waits();
    has_wrench_ = has_wrench;
    const bool anew = !ask.again && !was_cut;
    for (Start& s : course_->starts) s.moved = s.fresh = false;
    looking_ = anew || was_cut;
    if (has_wrench) {
      course_->spread.body = -1;
    } else {
      left_ -= kTried * static_cast<int>(course_->starts.size());
    }
    for (int i = 0; i < used_; ++i) turns_[i] = turn_of(views_[i]);
    for (const Turn turn : {Turn::begun, Turn::due, Turn::waits, Turn::last}) {
      for (int i = 0; i < used_; ++i) {
        if (turns_[i] == turn) search(views_[i], anew || turn < Turn::waits);
      }
    }
    units_ = all_ - left_;
    const bool cut = course_->cut();
    if (was_cut || cut) course_->move_on();
    complete_ = course_->complete = course_->complete || !cut;
  }

  // When a body's turn is: one that was begun with, has yet to be searched, or has points that have yet to
  // be improved comes before the others.
  enum class Turn : char { begun, due, waits, last };

  Turn turn_of(const View& view) const {
    if (course_->look.body == view.body || course_->spread.body == view.body) return Turn::begun;
    if (course_->due[view.body]) return Turn::due;
    const auto waits = [&](const Start& s) { return s.waits && surfaces_[s.surface].node == view.node; };
    const auto& all = course_->starts;
    return std::any_of(all.begin(), all.end(), waits) ? Turn::waits : Turn::last;
  }

  // `anew`: or does what has been found before serve?
  void search(View& view, bool anew) {
    char& due = course_->due[view.body];
    due = 0;
    if (!(view.floor < best_ + settings_.relevant)) {
      if (anew) drop([&](const Start& s) { return surfaces_[s.surface].node == view.node; });
      give_up(view);
      return;
    }
    if (view.line) {
      beside(view, anew && course_->spread.body != view.body);
    } else if (anew) {
      drop_starts(view);
    }
    if (!has_wrench_) search_spread(view, anew);
  }

  // Those of a body that belong to a line.
  void drop_starts(const View& view) {
    drop([&](const Start& s) {
      return surfaces_[s.surface].node == view.node && !(s.spread && !has_wrench_);
    });
  }
  template <class Which>
  void drop(Which&& which) {
    auto& all = course_->starts;
    all.erase(std::remove_if(all.begin(), all.end(), which), all.end());
  }

  // All entries of the line into the body.
  void enter(View& view) {
    const ForceLine line = view.later_line();
    const int before = count_;
    for (int s : *view.surfaces) {
      const auto entry = [&](int surface, const Vec3& point, const Vec3& normal, double) {
        if (count_ == kMost) return;
        Candidate& k = fresh(view, surface);
        k.point = point;
        k.normal = normal;
        k.fit.force = view.wrench.linear;
        fitter_.judge(view.q, view.earlier(point), normal, surfaces_[surface].graspable, k.fit);
        view.steep = view.steep || k.fit.cone < settings_.grazing;
        view.met = true;
        if (!known(before, 1e-7)) keep();  // an edge is met twice
      };
      surfaces_.entries(s, line, entry);
    }
  }

  // What the line misses by no more than the noise may be touched as well as what it enters; and
  // where it only grazes the body, better points are nearby.
  void beside(View& view, bool anew) {
    const int found = count_, own = index(view);
    const bool near = view.floor < best_ + settings_.face_sigmas * settings_.face_sigmas;
    if (!near) give_up(view);
    const bool searched = anew && near && look_around(view);
    const bool later = anew && near && !searched;
    if (later) course_->due[view.body] = 1;
    if (anew && !later) drop_starts(view);
    const bool passed = searched ? pass(view)
                                 : near && revisit(view, settings_.fine, settings_.faces_apart, false);
    for (int i = 0; searched && i < found; ++i) {  // what is entered now may be missed next
      if (candidates_[i].view == own) remember(view, candidates_[i], false);
    }
    if (!view.met && !passed && (has_wrench_ || anew)) miss(view);
    if (view.steep || left_ <= 0) return;
    for (int i = 0; i < found && count_ < kMost; ++i) {
      if (candidates_[i].view != own) continue;
      candidates_[count_] = candidates_[i];
      candidates_[i].fit.cone = std::numeric_limits<double>::infinity();  // replaced
      refinement_.improve(view, candidates_[count_], left_);
      if (!known(found, settings_.same_point)) keep();
    }
  }

  Candidate& fresh(const View& view, int surface) {
    Candidate& k = candidates_[count_];
    k = Candidate{};
    k.surface = surface;
    k.view = index(view);
    return k;
  }

  // Nothing of a body is waited for that cannot explain by now.
  void give_up(const View& view) {
    if (course_->look.body == view.body) course_->look.body = -1;
    if (course_->spread.body == view.body) course_->spread.body = -1;
    for (Start& s : course_->starts) s.waits = s.waits && surfaces_[s.surface].node != view.node;
  }

  // Looks for the faces that the line passes within the noise and at no grazing angle, apart from its
  // entries and from each other: the best point on each is in `passed_`. Returns whether it has come to
  // the end; if not, the next sample goes on.
  bool look_around(const View& view) {
    passes_ = 0;
    if (left_ <= 0) return false;
    const ForceLine line = view.later_line();
    const auto nearest = [&](const Vec3& p) {
      return line.at(dot(p - line.origin, line.direction));
    };
    double G[9];
    const Vec3 middle = view.earlier(nearest(posture_.pose(view.node).p));
    if (!fitter_.place_metric(view.q, middle, view.wrench.linear, G)) {
      if (course_->look.body == view.body) course_->look.body = -1;
      return true;
    }
    Beside metric = across(G, line.direction);
    const double limit = std::min(settings_.farthest, settings_.face_sigmas * widest(metric));
    // Weights are as exact as the larger one.
    for (double& weight : metric.weight)
      weight = std::max(0.0, weight - kRounding * std::fabs(metric.weight[1]));
    double worth = best_ + settings_.face_sigmas * settings_.face_sigmas;
    const auto most = [&](double cosine) {
      const double left = (1.0 + kRounding) * worth - view.floor;
      return cosine < 1.0 ? left - (1.0 - kRounding) * fitter_.cone_cost(cosine + kRounding) : left;
    };
    const auto offer = [&](int s, const Vec3& point, const Vec3& normal) {
      const double chi2 = view.floor + squared(G, point - nearest(point));
      if (!(chi2 < worth)) return;
      Candidate k;
      k.fit.chi2 = chi2;
      k.fit.cone = fitter_.cone_cost(-dot(normal, line.direction));
      if (!(k.fit.cost() < worth)) return;
      k.surface = s;
      k.view = index(view);
      k.point = point;
      k.normal = normal;
      if (entered(k)) return;
      passes_ = insert(passed_, kPassed, passes_, k, settings_.faces_apart);
      worth = std::min(worth, beaten(passed_, kPassed, passes_));
    };
    Look& look = course_->look;
    if (look.body != view.body) look = Look{};
    for (int i = 0; i < look.count; ++i) {
      const Start& best = look.best[i];
      offer(best.surface, surfaces_.to_world(best.point, view.node),
            surfaces_.turn_to_world(best.normal, view.node));
    }
    const int surfaces = static_cast<int>(view.surfaces->size());
    for (; look.surface < surfaces; ++look.surface, look.walk = Mesh::Walk{}) {
      const int s = (*view.surfaces)[look.surface];
      surfaces_.around(s, line, metric, limit, fitter_.steepest(), look.walk, left_, most,
                       [&](const SurfacePoint& p) { offer(s, p.point, p.normal); });
      if (!look.walk.done()) break;
    }
    if (look.surface == surfaces) {
      look.body = -1;
      return true;
    }
    for (int i = 0; i < count_; ++i) {  // what is entered now may be missed in the next sample
      if (candidates_[i].view == index(view))
        passes_ = insert(passed_, kPassed, passes_, candidates_[i], settings_.faces_apart);
    }
    look.body = view.body;
    look.count = passes_;
    for (int i = 0; i < passes_; ++i) look.best[i] = start_of(view, passed_[i]);
    return false;
  }

  // Improves what a look around has found. Returns whether that is anything.
  bool pass(View& view) {
    const Candidate* const starts = passed_;
    const int found = passes_;
    for (int i = 0; i < found && count_ < kMost; ++i) {
      place(view, starts[i].surface, starts[i].point, starts[i].normal);
      const bool waits = left_ <= 0;
      refinement_.improve(view, candidates_[count_], settings_.fine, settings_.faces_apart, left_);
      remember(view, candidates_[count_], waits);
      if (!known(0, settings_.same_point)) keep();
    }
    return found > 0;
  }

  // Starts from where the last search has ended, within `around` [m]. Returns whether it has found
  // anything on this body. Points that are `spread` are not improved as long as others are looked for.
  bool revisit(View& view, double finest, double around, bool spread) {
    bool any = false;
    for (Start& start : course_->starts) {
      if (surfaces_[start.surface].node != view.node || start.spread != spread) continue;
      const bool wanted = !start.fresh && (start.waits || !(waited_ || (spread && looking_)));
      if (wanted) start.waits = false;
      if (count_ == kMost) continue;
      any = true;
      place(view, start.surface, surfaces_.to_world(start.point, view.node),
            surfaces_.turn_to_world(start.normal, view.node));
      if (view.line && entered(candidates_[count_])) continue;
      if (!(candidates_[count_].fit.cost() < best_ + settings_.rough)) continue;
      start.waits = wanted && left_ <= 0;
      if (wanted && left_ > 0) {
        Candidate& k = candidates_[count_];
        refinement_.improve(view, k, finest, around, left_);
        start.moved = true;
        start.next_point = surfaces_.to_node(k.point, view.node);
        start.next_normal = surfaces_.turn_to_node(k.normal, view.node);
      }
      if (!known(0, settings_.same_point)) keep();
    }
    return any;
  }

  // `waits`: has it yet to be improved? Returns whether it is worth it.
  bool remember(const View& view, const Candidate& k, bool waits) {
    if (course_->starts.size() == kMost || !(k.fit.cost() < best_ + settings_.relevant)) return false;
    Start start = start_of(view, k);
    start.waits = waits;
    course_->starts.push_back(start);
    return true;
  }

  Start start_of(const View& view, const Candidate& k) const {
    return {k.surface, surfaces_.to_node(k.point, view.node),
            surfaces_.turn_to_node(k.normal, view.node)};
  }

  // Is there an entry of the line nearby that explains as well?
  bool entered(const Candidate& k) const {
    for (int i = 0; i < count_; ++i) {
      const Candidate& other = candidates_[i];
      if (other.view == k.view && norm(other.point - k.point) < settings_.faces_apart &&
          (other.fit.cone < settings_.grazing || other.fit.cost() < k.fit.cost()))
        return true;
    }
    return false;
  }

  int index(const View& view) const { return static_cast<int>(&view - views_.data()); }

  // Is the candidate at hand one of those from `first` on? Not one that is much worse: at a rim the
  // line may graze the face beside the one that is pushed.
  bool known(int first, double distance) const {
    const Candidate& k = candidates_[count_];
    for (int i = first; i < count_; ++i) {
      const Candidate& other = candidates_[i];
      if (other.surface == k.surface && norm(other.point - k.point) < distance &&
          other.fit.cost() < k.fit.cost() + settings_.grazing)
        return true;
    }
    return false;
  }

  void keep() {
    const double cost = candidates_[count_].fit.cost();
    if (!(cost < best_ + settings_.cost_window)) return;
    best_ = std::min(best_, cost);
    if (count_ < kMost) ++count_;
  }

  // The surface nearest to the line, and from there the best explanation nearby.
  void miss(View& view) {
    const ForceLine line = view.later_line();
    for (int s : *view.surfaces) {
      if (left_ <= 0) {
        miss_later(view, s);
        continue;
      }
      int looked = 0;
      const SurfacePoint p = surfaces_.nearest(s, line, settings_.farthest, missed_[s], looked);
      left_ -= kNearest * looked;
      if (p.face < 0 || count_ == kMost) continue;
      missed_[s] = p.place;
      // At an edge the normal is that of either side: what counts is the wrench alone.
      if (fitter_.free_chi2(view.q, view.earlier(p.point)) > best_ + settings_.relevant) continue;
      place(view, s, p.point, p.normal);
      improve_missed(view, course_->missed[s]);
      keep();
    }
  }

  // Without work left, what was found last on a surface stands.
  void miss_later(const View& view, int surface) {
    const Start& best = course_->missed[surface];
    if (best.surface < 0) course_->due[view.body] = 1;
    if (best.surface < 0 || count_ == kMost) return;
    place(view, surface, surfaces_.to_world(best.point, view.node),
          surfaces_.turn_to_world(best.normal, view.node));
    keep();
  }

  // From the candidate at hand the best explanation nearby: some work there is for it, once a search has
  // come so far.
  void improve_missed(const View& view, Start& best) {
    Candidate& k = candidates_[count_];
    const int more = std::max(0, kSome - left_);
    left_ += more;
    refinement_.improve(view, k, left_);
    left_ -= more;
    best = start_of(view, k);
  }

  void place(const View& view, int surface, const Vec3& point, const Vec3& normal,
             double limit = std::numeric_limits<double>::infinity()) {
    Candidate& k = fresh(view, surface);
    k.point = point;
    k.normal = normal;
    k.fit = fitter_.fit(view.q, view.earlier(k.point), k.normal, surfaces_[surface].graspable, limit);
  }

  // Without a wrench: the best of the points spread over each link, each improved. Until all of a surface
  // have been, those that were found before stand.
  void search_spread(View& view, bool anew) {
    const bool looked = anew && course_->look.body != view.body && look_over(view);
    if (anew && !looked) course_->due[view.body] = 1;
    revisit(view, settings_.coarse, 4.0 * settings_.coarse, true);
  }

  // Returns whether all surfaces of a body have been looked over; if not, the next sample goes on.
  bool look_over(View& view) {
    SpreadLook& look = course_->spread;
    if (look.body < 0) look = SpreadLook{}, look.body = view.body;
    if (look.body != view.body) return false;
    const int surfaces = static_cast<int>(view.surfaces->size());
    while (look.surface < surfaces && count_ < kMost) {
      if (!look_over(view, (*view.surfaces)[look.surface], look)) return false;
      const int next = look.surface + 1;
      look = SpreadLook{};
      look.body = view.body;
      look.surface = next;
    }
    look.body = -1;
    return true;
  }

  bool look_over(View& view, int surface, SpreadLook& look) {
    const std::vector<SurfaceSample>& samples = surfaces_.samples(surface);
    const int all = static_cast<int>(samples.size());
    Candidate starts[kStarts];
    int found = 0;
    for (; found < look.count; ++found) starts[found] = placed(view, look.best[found]);
    Lanes least{};  // that a force at each of the next points costs
    for (int at = 0; look.sample < all && left_ > 0; ++look.sample, ++at, left_ -= kTried) {
      if (at % kLanes == 0) least = least_costs(view, samples, look.sample);
      if (lane(least, at % kLanes) >= beaten(starts, kStarts, found)) continue;
      const SurfaceSample& sample = samples[look.sample];
      const double few = settings_.rough_few;
      const double limit = std::max(
          best_ + settings_.rough, found < kStarts ? few : worst(starts, found)->fit.cost());
      place(view, surface, surfaces_.to_world(sample.point, view.node),
            surfaces_.turn_to_world(sample.normal, view.node), limit);
      found = insert(starts, kStarts, found, candidates_[count_], settings_.start_spacing);
    }
    for (; look.sample == all && look.improved < found && left_ > 0; ++look.improved)
      improve_rough(view, starts[look.improved]);
    const bool done = look.sample == all && look.improved == found;
    if (done) drop([&](const Start& s) { return s.surface == surface && s.spread; });
    look.count = found;
    for (int i = 0; i < found; ++i) {
      look.best[i] = start_of(view, starts[i]);
      if (!done || !remember(view, starts[i], false)) continue;
      course_->starts.back().spread = course_->starts.back().fresh = true;
    }
    return done;
  }

  // What a force costs at least at the points of a body from `first` on, side by side.
  Lanes least_costs(const View& view, const std::vector<SurfaceSample>& samples, int first) const {
    BasicVec3<Lanes> points{};
    for (int k = 0; k < kLanes; ++k) {
      const std::size_t i = std::min<std::size_t>(first + k, samples.size() - 1);
      const Vec3 p = view.earlier(surfaces_.to_world(samples[i].point, view.node));
      set_lane(points.x, k, p.x);
      set_lane(points.y, k, p.y);
      set_lane(points.z, k, p.z);
    }
    return fitter_.least_cost(view.q, points);
  }

  // A point that is as rough as those of a surface are far apart: some work there is for it.
  void improve_rough(const View& view, Candidate& k) {
    const int more = std::max(0, kSome - left_);
    left_ += more;
    if (!refinement_.descend(view, k, left_) && k.fit.cost() < best_ + settings_.rough)
      refinement_.settle(view, k, settings_.coarse, 0.8 * settings_.start_spacing, left_);
    left_ -= more;
  }

  // A start, as it explains now.
  Candidate placed(const View& view, const Start& start) {
    place(view, start.surface, surfaces_.to_world(start.point, view.node),
          surfaces_.turn_to_world(start.normal, view.node));
    return candidates_[count_];
  }

  const Posture& posture_;
  const PlaceSettings& settings_;
  ForceFitter fitter_;
  LinkSurfaces surfaces_;
  Refinement refinement_;
  std::vector<View> views_;
  std::vector<Candidate> candidates_;
  std::vector<int> missed_;  // per surface: the triangle that a line has missed least, last; -1: none
  std::vector<Course> courses_;  // per segment and purpose
  // Of the search at hand: which it is, units of work in all, left, and that it took; did starts wait
  // before it, and is it complete? When the turn of each view is.
  Course* course_ = nullptr;
  int all_ = 0, left_ = 0, units_ = 0;
  bool waited_ = false, complete_ = true;
  bool looking_ = false, has_wrench_ = false;  // is anything looked for anew; is a wrench measured?
  std::vector<Turn> turns_;
  // Of the body at hand: the faces that the line passes.
  Candidate passed_[kPassed];
  int passes_ = 0;
  int used_ = 0, count_ = 0;
  double best_ = 0.0;
};

}  // namespace touchline
