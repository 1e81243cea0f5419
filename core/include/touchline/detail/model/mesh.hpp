// SPDX-License-Identifier: Apache-2.0
// The triangles of one link with a bounding volume hierarchy: every crossing of a line, the point
// nearest to a line, the point nearest to a point. No allocation after construction.
// Theory: docs/theory.md, section 1.4.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/spatial.hpp"

namespace touchline {

// A line in space; `direction` is a unit vector.
struct ForceLine {
  Vec3 origin, direction;
  Vec3 at(double t) const { return origin + t * direction; }
};

// A crossing at `line.at(t)`: an entry where the outward normal stands against the direction.
struct Crossing {
  double t = 0.0;
  int face = -1;
  Vec3 normal;
};

// What ways beside a line weigh: the square along each of two unit axes across it, times a weight
// [1/m2].
struct Beside {
  std::array<Vec3, 2> axis;
  std::array<double, 2> weight;
};

struct SurfacePoint {
  double distance = std::numeric_limits<double>::infinity();
  int face = -1;
  int place = -1;  // of the triangle in `Mesh::triangles`, where it is told
  Vec3 point, normal;
};

struct Triangle {
  Vec3 a, ab, ac, normal;
  int face;  // index in the order given
};

class Mesh {
  static constexpr int kDepth = 64;  // room: boxes that wait to be looked into

 public:
  // How far a look at a mesh has come: the boxes that wait, at first the one that holds all.
  class Walk {
   public:
    bool done() const { return waiting_ == 0; }

   private:
    friend Mesh;
    int boxes_[kDepth] = {0}, waiting_ = 1;
  };

  Mesh() : Mesh(std::vector<Triangle>{}) {}  // without triangles
  Mesh(const std::vector<Vec3>& vertices, const std::vector<std::array<int, 3>>& faces)
      : tree_(std::make_shared<Hierarchy>(triangles_of(vertices, faces))) {}
  // From the triangles of another mesh, in any order: answers are the same, to the last bit.
  explicit Mesh(std::vector<Triangle> triangles)
      : tree_(std::make_shared<Hierarchy>(by_face(std::move(triangles)))) {}

  const std::vector<Triangle>& triangles() const { return tree_->triangles; }
  bool empty() const { return tree_->triangles.empty(); }

  // Is a point in the box about all of it, or no farther from that than `reach` [m]?
  bool within(const Vec3& p, double reach) const {
    if (empty()) return false;
    const Box& all = tree_->boxes[0];
    const auto beside = [](double x, float low, float high) { return std::max({low - x, x - high, 0.0}); };
    const Vec3 way{beside(p.x, all.low.x, all.high.x), beside(p.y, all.low.y, all.high.y),
                   beside(p.z, all.low.z, all.high.z)};
    return dot(way, way) <= reach * reach;
  }

  // Calls `visit(Crossing)` for each crossing of the whole line, in no order. A line through an
  // edge is reported by both triangles and never by none.
  template <class Visit>
  void crossings(const ForceLine& line, Visit&& visit) const {
    const Vec3 inverse = invert(line.direction);
    if (empty()) return;
    int stack[2 * kDepth], size = 0;
    stack[size++] = tree_->root;
    while (size > 0) {
      const int child = stack[--size];
      if (child < 0) {
        cross_leaf(~child, line, visit);
        continue;
      }
      const Four& four = tree_->fours[child];
      bool crossed[Four::kChildren];
      four.crosses(line.origin, inverse, crossed);
      for (int i = 0; i < Four::kChildren; ++i) {
        if (!crossed[i]) continue;
        tree_->fetch(four.child[i]);
        stack[size++] = four.child[i];
      }
    }
  }

  // The point of the surface nearest to the line, if nearer than `limit`. `near`: the place of a
  // triangle that may be near, or -1: then there is less to search. The answer is the same. `looked`
  // grows by the number of places that were looked into.
  SurfacePoint nearest_to_line(const ForceLine& line, double limit, int near, int& looked) const {
    if (near >= 0) {
      SurfacePoint there;
      there.distance = limit;
      nearer_to_line(triangles()[near], line, there);
      limit = std::min(limit, (1.0 + kRounding) * there.distance + kRounding * kTouching);
    }
    const Cutoff cutoff(line, {across(line.direction), {0.0, 0.0}});
    return nearest(
        limit, -1,
        [&](const Box& b) {
          const Vec3 low = exact(b.low), high = exact(b.high);
          const Vec3 centre = 0.5 * (low + high) - line.origin;
          const Vec3 beside = centre - dot(centre, line.direction) * line.direction;
          return norm(beside) - 0.5 * norm(high - low);
        },
        [](double distance) { return distance; },
        [&](const Box& b, double distance) {
          ++looked;
          return cutoff.may_hold(b, distance * distance, kFar);
        },
        [&](const Triangle& tri, SurfacePoint& best) {
          const double before = best.distance;
          nearer_to_line(tri, line, best);
          if (best.distance < before) best.place = static_cast<int>(&tri - triangles().data());
        });
  }
  SurfacePoint nearest_to_line(const ForceLine& line,
                               double limit = std::numeric_limits<double>::infinity(),
                               int near = -1) const {
    int looked = 0;
    return nearest_to_line(line, limit, near, looked);
  }

  // Calls `visit(SurfacePoint)` for the point nearest to the line of each triangle that is nearer
  // to it than `limit` and stands against it: at a cosine above `steep`. Triangles of which every
  // point is at a weighed square of `most(cosine)` or more are left out; that may shrink meanwhile, and
  // is nowhere more than at cosine 1. Goes on from where `walk` is, as long as there are units of work
  // `left`, which it takes from: places that are looked into.
  template <class Most, class Visit>
  void around(const ForceLine& line, const Beside& beside, double limit, double steep, Walk& walk,
              int& left, Most&& most, Visit&& visit) const {
    const Cutoff cutoff(line, beside);
    const double square = limit * limit;
    const Triangle* some[kTogether];
    int count = 0;
    const auto look = [&] {
      for (int i = 0; i < count; i += kLanes)
        nearer_to_line(some + i, std::min(kLanes, count - i), line, limit, visit);
      count = 0;
    };
    visit_triangles(
        walk, [&] { return left > 0; },
        [&](const Box& box, int index) {
          --left;
          return cutoff.may_hold(box, square, most(1.0)) &&
                 tree_->faces[index].may_stand_against(line.direction, steep);
        },
        [&](const Triangle& tri) {
          const double cosine = -dot(tri.normal, line.direction);
          if (!(cosine > steep) || !cutoff.may_hold(tri, square, most(cosine))) return;
          some[count++] = &tri;
          left -= kNearLooked;
          if (count == kTogether) look();
        });
    look();
  }

  // What is near a triangle will be looked at soon: has it brought from memory while something else is
  // done.
  void expect(int near) const {
    if (near < 0) return;
    fetch_lines(&tree_->triangles[near], sizeof(Triangle));
    tree_->fetch(~tree_->side_of[near]);
  }

  // The point of the surface nearest to `p`, if nearer than `limit`. `near`: the place of a triangle
  // that may be near: then there is less to search. `looked` grows by the number of places that were
  // looked into: what it took, on any machine.
  SurfacePoint nearest_to_point(const Vec3& p, double limit, int near, int& looked) const {
    SurfacePoint best;
    best.distance = limit;
    if (empty()) return best;
    if (near >= 0) {
      const Triangle& tri = triangles()[near];
      const bool may = std::fabs(dot(tri.normal, p - tri.a)) < best.distance;
      if (may && offer(tri, nearest_on(tri, p), p, best)) best.place = near;
      if (best.distance < kTouching) return best;
    }
    struct Entry {
      double bound;
      int child;  // as in `Four`
    } stack[2 * kDepth];
    Found found;
    int size = 0;
    stack[size++] = {0.0, tree_->root};
    while (size > 0) {
      const Entry entry = stack[--size];
      const double far = best.distance * best.distance;
      if (entry.bound >= far) continue;
      ++looked;
      if (entry.child < 0) {
        offer_leaf(~entry.child, p, best, found);
        continue;
      }
      const Four& four = tree_->fours[entry.child];
      double bound[Four::kRoom];
      four.outside(p, bound);
      const auto push = [&](int i) {
        if (!(bound[i] < far)) return;
        tree_->fetch(four.child[i]);
        stack[size++] = {bound[i], four.child[i]};
      };
      // The nearer half is visited first, and in each half the nearer box.
      const int one = bound[4] > bound[5] ? 2 : 0, other = 2 - one;
      const int first = one + (bound[one] > bound[one + 1]);
      const int third = other + (bound[other] > bound[other + 1]);
      push(2 * other + 1 - third);
      push(third);
      push(2 * one + 1 - first);
      push(first);
    }
    if (found.side >= 0) {
      const TriangleLanes& side = tree_->side_by_side[found.side];
      const Numbers& numbers = tree_->numbers[found.side];
      const int k = found.lane;
      best.face = numbers.face[k];
      best.place = numbers.place + k;
      best.normal = {lane(side.normal.x, k), lane(side.normal.y, k), lane(side.normal.z, k)};
    }
    return best;
  }
  SurfacePoint nearest_to_point(const Vec3& p,
                                double limit = std::numeric_limits<double>::infinity(),
                                int near = -1) const {
    int looked = 0;
    return nearest_to_point(p, limit, near, looked);
  }

 private:
  static constexpr std::size_t kLine = 64;  // bytes of a line of a cache
  static constexpr int kLeaf = 4;  // triangles of a leaf
  static constexpr int kTogether = 4;    // triangles looked at at once, however many lanes there are
  static constexpr int kNearLooked = 2;  // places: a triangle near a line takes as long as so many boxes
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  static constexpr double kTouching = 1e-9;  // nearer than this nothing nearer is looked for [m]
  static constexpr double kFar = std::numeric_limits<double>::infinity();
  static constexpr double kRounding = 1e-9;  // of ways [m], and a part of what they weigh
  static constexpr double kEdge = 1e-9;  // of barycentric coordinates: edges belong to both sides

  struct Bounds {
    Vec3 low, high;
  };
  struct Box {
    BasicVec3<float> low, high;  // rounded outwards: half of the memory, where time goes
    int next;   // a leaf's first triangle, or an inner box's second child (the first follows it)
    int count;  // triangles of a leaf; 0: an inner box
  };

  // Four boxes side by side: the children of the two children of an inner box, and those two. Where one
  // of the two is a leaf, it stands there alone.
  struct Four {
    static constexpr int kChildren = 4, kRoom = 8;  // room: for the two, of which no four lanes are full
    float half_low[3][2], half_high[3][2];
    float low[3][kChildren], high[3][kChildren];
    int child[kChildren];  // another four, or ~ the number of a leaf's first triangles side by side

    void put(int i, const Box& box) {
      const float* const ends[2] = {&box.low.x, &box.high.x};
      for (int axis = 0; axis < 3; ++axis) {
        low[axis][i] = ends[0][axis];
        high[axis][i] = ends[1][axis];
      }
    }
    void put_half(int i, const Box& box) {
      const float* const ends[2] = {&box.low.x, &box.high.x};
      for (int axis = 0; axis < 3; ++axis) {
        half_low[axis][i] = ends[0][axis];
        half_high[axis][i] = ends[1][axis];
      }
    }
    // No point is as near as to this, and no line crosses it.
    void put_none(int i) {
      for (int axis = 0; axis < 3; ++axis) {
        low[axis][i] = kInfinity;
        high[axis][i] = -kInfinity;
      }
    }

    // The square of how far a point is outside of each of the four, and of the two behind them. What
    // is beyond the two in their lanes has no meaning.
    void outside(const Vec3& p, double* out) const {
      const BasicVec3<Lanes> at = many(p);
      for (int i = 0; i < kChildren; i += kLanes)
        store_lanes(outside(at, &low[0][i], &high[0][i], kChildren), out + i);
      for (int i = 0; i < 2; i += kLanes)
        store_lanes(outside(at, &half_low[0][i], &half_high[0][i], 2), out + kChildren + i);
    }

    // Does a line through `o` cross each of the four?
    void crosses(const Vec3& o, const Vec3& inverse, bool* out) const {
      const BasicVec3<Lanes> from = many(o), by = many(inverse);
      for (int i = 0; i < kChildren; i += kLanes) {
        const Lanes x0 = (lanes_of_floats(low[0] + i) - from.x) * by.x,
                    x1 = (lanes_of_floats(high[0] + i) - from.x) * by.x,
                    y0 = (lanes_of_floats(low[1] + i) - from.y) * by.y,
                    y1 = (lanes_of_floats(high[1] + i) - from.y) * by.y,
                    z0 = (lanes_of_floats(low[2] + i) - from.z) * by.z,
                    z1 = (lanes_of_floats(high[2] + i) - from.z) * by.z;
        const Lanes enter = larger(larger(smaller(x0, x1), smaller(y0, y1)), smaller(z0, z1));
        const Lanes leave = smaller(smaller(larger(x0, x1), larger(y0, y1)), larger(z0, z1));
        for (int k = 0; k < kLanes; ++k)
          out[i + k] = child[i + k] != kNone && lane(enter, k) <= lane(leave, k);
      }
    }
    static constexpr int kNone = std::numeric_limits<int>::max();  // where there is no child

   private:
    static Lanes outside(const BasicVec3<Lanes>& at, const float* low, const float* high,
                         int stride) {
      const Lanes* const x = &at.x;
      Lanes sum{};
      for (int axis = 0; axis < 3; ++axis, low += stride, high += stride) {
        const Lanes beyond = larger(lanes_of_floats(low) - x[axis], x[axis] - lanes_of_floats(high));
        const Lanes d = larger(beyond, Lanes{});
        sum = axis == 0 ? d * d : sum + d * d;
      }
      return sum;
    }
  };

  // Triangles side by side; what is beyond the last one repeats it. Whole lines of a cache: what decides
  // whether the others are looked at comes first.
  struct alignas(64) TriangleLanes {
    BasicVec3<Lanes> a, normal, ab, ac;
  };
  // Of such: the place of the first in `triangles`, how many there are, and their faces.
  struct Numbers {
    int place, count;
    int face[kLanes];
  };
  // The nearest one so far among them; -1: none.
  struct Found {
    int side = -1, lane = 0;
  };

  // The directions of all normals in a box: within an angle of a cosine about an axis.
  struct Facing {
    BasicVec3<float> axis;
    float cosine = -1.0f, sine = 0.0f;  // -1: in all directions

    // May one of them be `n` with -n . direction > steep? If in doubt, yes.
    bool may_stand_against(const Vec3& direction, double steep) const {
      if (cosine <= 0.0f) return true;
      const double x = -(axis.x * direction.x + axis.y * direction.y + axis.z * direction.z);
      if (x >= cosine) return true;
      // The nearest of them to -direction is the angle of the cone away from the axis towards it.
      const double most = x * cosine + std::sqrt(std::max(0.0, 1.0 - x * x)) * sine;
      return most > steep - kRounded;
    }
    static constexpr double kRounded = 1e-5;  // of the cosines, which are floats
  };

  // What is beside a line by less than a distance, and by less than a weighed square. If in doubt,
  // it is.
  class Cutoff {
   public:
    Cutoff(const ForceLine& line, const Beside& beside) {
      for (int i = 0; i < 2; ++i) {
        const Vec3& a = axis_[i] = beside.axis[i];
        size_[i] = {std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)};
        from_[i] = dot(a, line.origin);
        weight_[i] = beside.weight[i];
      }
    }

    bool may_hold(const Box& box, double square, double most) const {
      const Vec3 low = exact(box.low), high = exact(box.high);
      const Vec3 twice = low + high, size = high - low;  // of the centre, of half the size
      double way[2];
      for (int i = 0; i < 2; ++i)
        way[i] = std::fabs(0.5 * dot(axis_[i], twice) - from_[i]) - 0.5 * dot(size_[i], size);
      return holds(way, square, most);
    }

    bool may_hold(const Triangle& tri, double square, double most) const {
      double way[2];
      for (int i = 0; i < 2; ++i) {
        const double a = dot(axis_[i], tri.a) - from_[i];
        const double b = a + dot(axis_[i], tri.ab), c = a + dot(axis_[i], tri.ac);
        way[i] = std::max(std::min({a, b, c}), -std::max({a, b, c}));
      }
      return holds(way, square, most);
    }

   private:
    bool holds(const double* way, double square, double most) const {
      double near[2];
      for (int i = 0; i < 2; ++i) {
        const double w = std::max(0.0, way[i] - kRounding);
        near[i] = (1.0 - kRounding) * w * w;
      }
      return near[0] + near[1] < square && weight_[0] * near[0] + weight_[1] * near[1] < most;
    }

    Vec3 axis_[2], size_[2];
    double from_[2], weight_[2];
  };

  // Triangles in the order of their boxes. Copies of a mesh share it: it never changes.
  struct Hierarchy {
    explicit Hierarchy(std::vector<Triangle> of) : triangles(std::move(of)) {
      boxes.reserve(triangles.size() + 1);
      if (!triangles.empty()) build(0, static_cast<int>(triangles.size()));
      faces.resize(boxes.size());
      for (std::size_t i = boxes.size(); i-- > 0;) {
        int end = static_cast<int>(i);  // the last leaf of this box
        while (boxes[end].count == 0) end = boxes[end].next;
        int begin = static_cast<int>(i);
        while (boxes[begin].count == 0) ++begin;
        faces[i] = facing(boxes[begin].next, boxes[end].next + boxes[end].count);
      }
      side_of.resize(triangles.size());
      root = boxes.empty() ? 0 : gather(0);
    }

    // What stands at a child of a four will be looked at soon.
    void fetch(int child) const {
      child < 0 ? fetch_lines(side_by_side.data() + ~child, sizeof(TriangleLanes))
                : fetch_lines(fours.data() + child, sizeof(Four));
    }

    // The fours of a box and of all in it; how it is called in `Four::child`.
    int gather(int box) {
      if (boxes[box].count > 0) return ~put_side_by_side(boxes[box].next, boxes[box].count);
      const int index = static_cast<int>(fours.size());
      fours.push_back({});
      Four four{};
      const int halves[2] = {box + 1, boxes[box].next};
      for (int half = 0; half < 2; ++half) {
        const int own = halves[half];
        const bool leaf = boxes[own].count > 0;
        const int of[2] = {leaf ? own : own + 1, boxes[own].next};
        four.put_half(half, boxes[own]);
        for (int i = 0; i < 2; ++i) {
          const int at = 2 * half + i;
          if (leaf && i == 1) {
            four.put_none(at);
            four.child[at] = Four::kNone;
            continue;
          }
          four.put(at, boxes[of[i]]);
          four.child[at] = gather(of[i]);
        }
      }
      fours[index] = four;
      return index;
    }

    // Triangles of a leaf, side by side; the number of the first of those.
    int put_side_by_side(int begin, int count) {
      const int first = static_cast<int>(side_by_side.size());
      for (int i = 0; i < count; i += kLanes) {
        for (int k = 0; k < std::min(kLanes, count - i); ++k)
          side_of[begin + i + k] = static_cast<int>(side_by_side.size());
        side_by_side.push_back(lanes_of(begin + i, count - i));
        Numbers own{begin + i, count - i, {}};
        for (int k = 0; k < kLanes; ++k)
          own.face[k] = triangles[begin + std::min(i + k, count - 1)].face;
        numbers.push_back(own);
      }
      return first;
    }

    TriangleLanes lanes_of(int begin, int count) const {
      TriangleLanes out{};
      for (int k = 0; k < kLanes; ++k) {
        const Triangle& t = triangles[begin + std::min(k, count - 1)];
        for (const auto& [to, from] : {std::pair{&out.a, &t.a}, std::pair{&out.ab, &t.ab},
                                       std::pair{&out.ac, &t.ac}, std::pair{&out.normal, &t.normal}}) {
          set_lane(to->x, k, from->x);
          set_lane(to->y, k, from->y);
          set_lane(to->z, k, from->z);
        }
      }
      return out;
    }

    Facing facing(int begin, int end) const {
      Vec3 sum;
      for (int i = begin; i < end; ++i) sum += triangles[i].normal;
      const double size = norm(sum);
      if (!(size > 0.0)) return {};
      const Vec3 axis = (1.0 / size) * sum;
      double cosine = 1.0;
      for (int i = begin; i < end; ++i) cosine = std::min(cosine, dot(axis, triangles[i].normal));
      Facing out;
      out.axis = {static_cast<float>(axis.x), static_cast<float>(axis.y), static_cast<float>(axis.z)};
      out.cosine = static_cast<float>(cosine);
      out.sine = static_cast<float>(std::sqrt(std::max(0.0, 1.0 - cosine * cosine)));
      return out;
    }

    int build(int begin, int end) {
      const int index = static_cast<int>(boxes.size());
      boxes.push_back({});
      const Bounds exact = bounds(begin, end);
      Box box{rounded(exact.low, -kInfinity), rounded(exact.high, kInfinity), begin, end - begin};
      if (box.count > kLeaf) {
        split(begin, end, exact);
        boxes[index] = box;
        build(begin, (begin + end) / 2);
        box.next = build((begin + end) / 2, end);
        box.count = 0;
      }
      boxes[index] = box;
      return index;
    }

    static BasicVec3<float> rounded(const Vec3& v, float towards) {
      const auto round = [towards](double x) {
        return std::nextafter(static_cast<float>(x), towards);
      };
      return {round(v.x), round(v.y), round(v.z)};
    }

    void split(int begin, int end, const Bounds& box) {
      const Vec3 size = box.high - box.low;
      const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
      const auto centre = [axis](const Triangle& t) {
        const Vec3 c = 3.0 * t.a + t.ab + t.ac;
        return axis == 0 ? c.x : axis == 1 ? c.y : c.z;
      };
      std::nth_element(triangles.begin() + begin, triangles.begin() + (begin + end) / 2,
                       triangles.begin() + end, [&](const Triangle& s, const Triangle& t) {
                         return centre(s) < centre(t);
                       });
    }

    Bounds bounds(int begin, int end) const {
      constexpr double inf = std::numeric_limits<double>::infinity();
      Bounds box{{inf, inf, inf}, {-inf, -inf, -inf}};
      for (int i = begin; i < end; ++i) {
        const Triangle& t = triangles[i];
        for (const Vec3& p : {t.a, t.a + t.ab, t.a + t.ac}) {
          box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y), std::min(box.low.z, p.z)};
          box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y),
                      std::max(box.high.z, p.z)};
        }
      }
      const double pad = 1e-9 * (1.0 + norm(box.high - box.low));  // flat boxes, edge tolerance
      box.low = box.low - Vec3{pad, pad, pad};
      box.high = box.high + Vec3{pad, pad, pad};
      return box;
    }

    std::vector<Triangle> triangles;
    std::vector<Box> boxes;
    std::vector<Facing> faces;  // per box
    std::vector<Four> fours;
    int root = 0;  // as in `Four::child`
    std::vector<TriangleLanes> side_by_side;  // of the leaves
    std::vector<int> side_of;  // per triangle: where it stands there
    std::vector<Numbers> numbers;  // of each of those; `count`: with those of the leaf that follow
  };

  static std::vector<Triangle> triangles_of(const std::vector<Vec3>& vertices,
                                            const std::vector<std::array<int, 3>>& faces) {
    std::vector<Triangle> out;
    for (std::size_t i = 0; i < faces.size(); ++i) {
      const Vec3 a = vertices[faces[i][0]];
      const Vec3 ab = vertices[faces[i][1]] - a, ac = vertices[faces[i][2]] - a;
      const Vec3 n = cross(ab, ac);
      const double length = norm(n);
      if (length > 0.0) out.push_back({a, ab, ac, (1.0 / length) * n, static_cast<int>(i)});
    }
    return out;
  }
  static std::vector<Triangle> by_face(std::vector<Triangle> triangles) {
    std::sort(triangles.begin(), triangles.end(),
              [](const Triangle& s, const Triangle& t) { return s.face < t.face; });
    return triangles;
  }

  // Calls `visit(Triangle)` for all in boxes that are `reached(Box, its number)`, in no order, from where
  // `walk` is, as long as it `may` go on.
  template <class May, class Reached, class Visit>
  void visit_triangles(Walk& walk, May&& may, Reached&& reached, Visit&& visit) const {
    if (empty()) walk.waiting_ = 0;
    const Box* const boxes = tree_->boxes.data();
    const Triangle* const triangles = tree_->triangles.data();
    int size = walk.waiting_;
    while (size > 0 && may()) {
      const int index = walk.boxes_[--size];
      const Box& box = boxes[index];
      if (!reached(box, index)) continue;
      if (box.count == 0) {
        walk.boxes_[size++] = index + 1;
        walk.boxes_[size++] = box.next;
        continue;
      }
      for (int i = box.next; i < box.next + box.count; ++i) visit(triangles[i]);
    }
    walk.waiting_ = size;
  }

  // Two unit axes across a direction.
  static std::array<Vec3, 2> across(const Vec3& n) {
    const Vec3 helper = std::fabs(n.x) < 0.6 ? Vec3{1.0, 0.0, 0.0} : Vec3{0.0, 1.0, 0.0};
    const Vec3 s = cross(n, helper);
    const Vec3 unit = (1.0 / norm(s)) * s;
    return {unit, cross(n, unit)};
  }

  static Vec3 invert(const Vec3& d) {
    const auto inverse = [](double x) { return 1.0 / (std::fabs(x) > 1e-200 ? x : 1e-200); };
    return {inverse(d.x), inverse(d.y), inverse(d.z)};
  }

  static bool crosses(const Triangle& tri, const ForceLine& line, double& t) {
    const Vec3 p = cross(line.direction, tri.ac);
    const double det = dot(tri.ab, p);
    if (det == 0.0) return false;
    const Vec3 s = line.origin - tri.a;
    const double u = dot(s, p) / det;
    if (!(u >= -kEdge && u <= 1.0 + kEdge)) return false;
    const Vec3 q = cross(s, tri.ab);
    const double v = dot(line.direction, q) / det;
    if (!(v >= -kEdge && u + v <= 1.0 + kEdge)) return false;
    t = dot(tri.ac, q) / det;
    return true;
  }

  // `bound(box)`: what the `measure` of the distance of anything in a box is not less than; boxes are
  // visited in its order. `may_hold(box, distance)`: may it hold something that is nearer?
  template <class Bound, class Measure, class MayHold, class Offer>
  SurfacePoint nearest(double limit, int near, Bound&& bound, Measure&& measure, MayHold&& may_hold,
                       Offer&& offer_triangle) const {
    SurfacePoint best;
    best.distance = limit;
    if (empty()) return best;
    if (near >= 0) {
      offer_triangle(triangles()[near], best);
      if (best.distance < kTouching) return best;
    }
    const Box* const boxes = tree_->boxes.data();
    const Triangle* const triangles = tree_->triangles.data();
    struct Entry {
      double bound;
      int box;
    } stack[kDepth];
    int size = 0;
    stack[size++] = {bound(boxes[0]), 0};
    while (size > 0) {
      const Entry entry = stack[--size];
      if (entry.bound >= measure(best.distance)) continue;
      const Box& box = boxes[entry.box];
      if (!may_hold(box, best.distance)) continue;
      if (box.count > 0) {
        for (int i = box.next; i < box.next + box.count; ++i) offer_triangle(triangles[i], best);
        continue;
      }
      const double one = bound(boxes[entry.box + 1]), other = bound(boxes[box.next]);
      const double far = measure(best.distance);
      const bool swapped = one > other;  // the nearer one is visited first
      const double more = swapped ? one : other, less = swapped ? other : one;
      if (!(less < far)) continue;
      if (more < far) stack[size++] = {more, swapped ? entry.box + 1 : box.next};
      stack[size++] = {less, swapped ? box.next : entry.box + 1};
    }
    return best;
  }

  // Is it nearer?
  static bool offer(const Triangle& tri, const Vec3& point, const Vec3& target,
                    SurfacePoint& best) {
    const double distance = norm(point - target);
    if (!(distance < best.distance)) return false;
    best = {distance, tri.face, -1, point, tri.normal};
    return true;
  }

  // The triangles of a leaf, side by side; each as if alone and in their order, to the last bit. What
  // repeats another one is no nearer.
  void offer_leaf(int side, const Vec3& p, SurfacePoint& best, Found& found) const {
    for (int left = kLanes; left > 0; ++side) {
      const TriangleLanes& own = tree_->side_by_side[side];
      if (kLanes < kLeaf) left = tree_->numbers[side].count;
      left -= kLanes;
      const BasicVec3<Lanes> ap = many(p) - own.a;
      const Lanes above = dot(own.normal, ap), plane = larger(above, -above);
      if (!any_below(plane, all_lanes(best.distance))) continue;
      const BasicVec3<Lanes> point = nearest_on(own, ap), way = point - many(p);
      const Lanes distance = root(dot(way, way));
      if (!any_below(distance, all_lanes(best.distance))) continue;
      for (int k = 0; k < kLanes; ++k) {
        if (!(lane(plane, k) < best.distance && lane(distance, k) < best.distance)) continue;
        best.distance = lane(distance, k);
        best.point = {lane(point.x, k), lane(point.y, k), lane(point.z, k)};
        found = {side, k};
      }
    }
  }

  // Calls `visit(Crossing)` for those of a leaf that a line crosses, in their order.
  template <class Visit>
  void cross_leaf(int side, const ForceLine& line, Visit&& visit) const {
    for (int left = kLanes; left > 0; ++side) {
      const TriangleLanes& own = tree_->side_by_side[side];
      if (kLanes < kLeaf) left = tree_->numbers[side].count;
      left -= kLanes;
      Lanes t;
      const Lanes crossed = crosses(own.a, own.ab, own.ac, line, t);
      if (!any_below(all_lanes(0.0), crossed)) continue;
      const Numbers& numbers = tree_->numbers[side];
      for (int k = 0; k < std::min(kLanes, numbers.count); ++k) {
        if (!(lane(crossed, k) > 0.0)) continue;
        visit(Crossing{lane(t, k), numbers.face[k],
                       {lane(own.normal.x, k), lane(own.normal.y, k), lane(own.normal.z, k)}});
      }
    }
  }

  // `nearer_to_line` of several triangles side by side, each of which is offered as far as `limit`.
  template <class Visit>
  static void nearer_to_line(const Triangle* const* some, int count, const ForceLine& line,
                             double limit, Visit&& visit) {
    using Many = BasicVec3<Lanes>;
    const auto gather = [&](Vec3 Triangle::*member) {
      Many v;
      for (int k = 0; k < kLanes; ++k) {
        const Vec3& x = some[std::min(k, count - 1)]->*member;
        set_lane(v.x, k, x.x);
        set_lane(v.y, k, x.y);
        set_lane(v.z, k, x.z);
      }
      return v;
    };
    const Many a = gather(&Triangle::a), ab = gather(&Triangle::ab), ac = gather(&Triangle::ac);
    const Many corners[3] = {a, a + ab, a + ac};
    Lanes distance = all_lanes(limit);
    Many point{};
    for (int i = 0; i < 3; ++i) {
      const Many edge = corners[(i + 1) % 3] - corners[i];
      const Many e = edge - dot(edge, line.direction) * many(line.direction);
      const Many from = corners[i] - many(line.origin);
      const Many beside = from - dot(from, line.direction) * many(line.direction);
      const Lanes length = dot(e, e), zero = all_lanes(0.0), one = all_lanes(1.0);
      Lanes s = -dot(beside, e) / length;
      s = s < zero ? zero : one < s ? one : s;
      s = length > zero ? s : zero;
      const Many off = beside + s * e, at = corners[i] + s * edge;
      const Lanes way = root(dot(off, off));
      const auto nearer = way < distance;
      distance = nearer ? way : distance;
      point = {nearer ? at.x : point.x, nearer ? at.y : point.y, nearer ? at.z : point.z};
    }
    Lanes t;
    const Lanes crossed = crosses(a, ab, ac, line, t);
    for (int k = 0; k < count; ++k) {
      const Triangle& tri = *some[k];
      if (lane(crossed, k) > 0.0) {
        if (limit > 0.0) visit(SurfacePoint{0.0, tri.face, -1, line.at(lane(t, k)), tri.normal});
      } else if (lane(distance, k) < limit) {
        visit(SurfacePoint{lane(distance, k), tri.face, -1,
                           {lane(point.x, k), lane(point.y, k), lane(point.z, k)}, tri.normal});
      }
    }
  }
  // As `crosses` of one triangle: 1 where the line does, else 0.
  static Lanes crosses(const BasicVec3<Lanes>& a, const BasicVec3<Lanes>& ab,
                       const BasicVec3<Lanes>& ac, const ForceLine& line, Lanes& t) {
    const BasicVec3<Lanes> p = cross(line.direction, ac), s = many(line.origin) - a, q = cross(s, ab);
    const Lanes det = dot(ab, p), u = dot(s, p) / det, v = dot(line.direction, q) / det;
    t = dot(ac, q) / det;
    const Lanes least = all_lanes(-kEdge), most = all_lanes(1.0 + kEdge), none = all_lanes(0.0);
    Lanes yes = all_lanes(1.0);  // not of a line along the plane: dividing by zero fails one of these
    yes = u >= least ? yes : none;
    yes = u <= most ? yes : none;
    yes = v >= least ? yes : none;
    return u + v <= most ? yes : none;
  }
  static BasicVec3<Lanes> many(const Vec3& v) {
    return {all_lanes(v.x), all_lanes(v.y), all_lanes(v.z)};
  }

  // Beside the line, the nearest point of a triangle lies on an edge.
  static void nearer_to_line(const Triangle& tri, const ForceLine& line, SurfacePoint& best) {
    double t;
    if (crosses(tri, line, t)) {
      if (best.distance > 0.0) best = {0.0, tri.face, -1, line.at(t), tri.normal};
      return;
    }
    const Vec3 corners[3] = {tri.a, tri.a + tri.ab, tri.a + tri.ac};
    for (int i = 0; i < 3; ++i) {
      const Vec3 edge = corners[(i + 1) % 3] - corners[i];
      const Vec3 e = edge - dot(edge, line.direction) * line.direction;
      const Vec3 from = corners[i] - line.origin;
      const Vec3 a = from - dot(from, line.direction) * line.direction;
      const double length = dot(e, e);
      const double s = length > 0.0 ? std::clamp(-dot(a, e) / length, 0.0, 1.0) : 0.0;
      const double distance = norm(a + s * e);
      if (distance < best.distance)
        best = {distance, tri.face, -1, corners[i] + s * edge, tri.normal};
    }
  }

  // By the region of the plane that the point lies in (Ericson, Real-Time Collision Detection).
  static Vec3 nearest_on(const Triangle& tri, const Vec3& p) {
    const Vec3 ap = p - tri.a;
    const double d1 = dot(tri.ab, ap), d2 = dot(tri.ac, ap);
    if (d1 <= 0.0 && d2 <= 0.0) return tri.a;
    const Vec3 bp = ap - tri.ab;
    const double d3 = dot(tri.ab, bp), d4 = dot(tri.ac, bp);
    if (d3 >= 0.0 && d4 <= d3) return tri.a + tri.ab;
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return tri.a + (d1 / (d1 - d3)) * tri.ab;
    const Vec3 cp = ap - tri.ac;
    const double d5 = dot(tri.ab, cp), d6 = dot(tri.ac, cp);
    if (d6 >= 0.0 && d5 <= d6) return tri.a + tri.ac;
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return tri.a + (d2 / (d2 - d6)) * tri.ac;
    const double va = d3 * d6 - d5 * d4;
    if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0)
      return tri.a + tri.ab + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (tri.ac - tri.ab);
    const double scale = 1.0 / (va + vb + vc);
    return tri.a + (vb * scale) * tri.ab + (vc * scale) * tri.ac;
  }

  // The same of several side by side, `ap` from each one's corner: all regions, of which one counts.
  static BasicVec3<Lanes> nearest_on(const TriangleLanes& tri, const BasicVec3<Lanes>& ap) {
    using Many = BasicVec3<Lanes>;
    const Lanes zero = all_lanes(0.0);
    const Many bp = ap - tri.ab, cp = ap - tri.ac, b = tri.a + tri.ab;
    const Lanes d1 = dot(tri.ab, ap), d2 = dot(tri.ac, ap), d3 = dot(tri.ab, bp),
                d4 = dot(tri.ac, bp), d5 = dot(tri.ab, cp), d6 = dot(tri.ac, cp);
    const Lanes va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    const Lanes scale = all_lanes(1.0) / (va + vb + vc);
    Many at = tri.a + (vb * scale) * tri.ab + (vc * scale) * tri.ac;
    const auto choose = [&at](const auto& here, const Many& x) {
      at = {here ? x.x : at.x, here ? x.y : at.y, here ? x.z : at.z};
    };
    choose((va <= zero) & (d4 - d3 >= zero) & (d5 - d6 >= zero),
           b + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (tri.ac - tri.ab));
    choose((vb <= zero) & (d2 >= zero) & (d6 <= zero), tri.a + (d2 / (d2 - d6)) * tri.ac);
    choose((d6 >= zero) & (d5 <= d6), tri.a + tri.ac);
    choose((vc <= zero) & (d1 >= zero) & (d3 <= zero), tri.a + (d1 / (d1 - d3)) * tri.ab);
    choose((d3 >= zero) & (d4 <= d3), b);
    choose((d1 <= zero) & (d2 <= zero), tri.a);
    return at;
  }

  // Asks for so many bytes from memory, and does not wait for them.
  static void fetch_lines(const void* at, std::size_t bytes) {
#if defined(__GNUC__) || defined(__clang__)
    for (std::size_t i = 0; i < bytes; i += kLine)
      __builtin_prefetch(static_cast<const char*>(at) + i);
#else
    static_cast<void>(at), static_cast<void>(bytes);
#endif
  }

  static Vec3 exact(const BasicVec3<float>& v) { return {v.x, v.y, v.z}; }

  std::shared_ptr<const Hierarchy> tree_;
};

}  // namespace touchline
