// SPDX-License-Identifier: Apache-2.0
// Topics of ROS 2 without Python: what rclpy has subscribed to and advertised is taken and published
// by native threads, as CDR, through the C interface of rcl.
//
// No header of ROS is used. The functions come as addresses, and what they take is declared here as
// it has been since ROS 2 Humble (rcl/subscription.h, rcl/publisher.h, rcutils/types/uint8_array.h,
// rcutils/allocator.h, rmw/types.h).
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <charconv>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "live_bindings.hpp"
#include "pipeline_bindings.hpp"
#include "topics.hpp"
#include "touchline/live.hpp"

namespace touchline::live {

// rcutils_allocator_t and rcutils_uint8_array_t.
struct RclAllocator {
  void* (*allocate)(std::size_t, void*);
  void (*deallocate)(void*, void*);
  void* (*reallocate)(void*, std::size_t, void*);
  void* (*zero_allocate)(std::size_t, std::size_t, void*);
  void* state;
};
struct RclBytes {
  std::uint8_t* buffer;
  std::size_t length, capacity;
  RclAllocator allocator;
};
// rmw_message_info_t, with room behind it for what other versions add.
struct RclInfo {
  std::int64_t source_time, received_time;  // [ns]
  std::uint64_t published, received;        // numbers of the message; all bits set: not counted
  const char* implementation;
  std::uint8_t publisher[24];
  std::uint8_t rest[192];
};
using RclOnNew = void (*)(const void*, std::size_t);
using RclSetOnNew = int (*)(const void* subscription, RclOnNew, const void*);
using RclTake = int (*)(const void* subscription, RclBytes*, RclInfo*, void*);
using RclPublish = int (*)(const void* publisher, const RclBytes*, void*);

inline RclAllocator plain_memory() {
  return {[](std::size_t size, void*) { return std::malloc(size); },
          [](void* memory, void*) { std::free(memory); },
          [](void* memory, std::size_t size, void*) { return std::realloc(memory, size); },
          [](std::size_t count, std::size_t size, void*) { return std::calloc(count, size); },
          nullptr};
}

inline double wall_seconds() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  const auto ns = std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
  return static_cast<double>(ns / 1000000000) + static_cast<double>(ns % 1000000000) * 1e-9;
}

// Takes the messages of subscriptions in a thread of its own, and makes samples of them. They wait
// for Python until a runner is attached, which takes them from then on.
class TopicReader {
 public:
  TopicReader(tl::TopicNames names, std::size_t take, std::size_t set_on_new,
              std::vector<std::size_t> subscriptions, std::size_t slots)
      : merge_(std::move(names)),
        take_(reinterpret_cast<RclTake>(take)),
        set_on_new_(reinterpret_cast<RclSetOnNew>(set_on_new)),
        waiting_(slots, blank()) {
    if (subscriptions.size() != 1 + merge_.sensors())
      throw std::invalid_argument("one subscription for the joint states and each sensor");
    for (const std::size_t s : subscriptions) topics_.push_back(Topic{reinterpret_cast<const void*>(s)});
    message_ = {static_cast<std::uint8_t*>(std::malloc(kRoom)), 0, kRoom, plain_memory()};
    scratch_ = blank();
    thread_ = std::thread([this] { work(); });
    for (const Topic& topic : topics_) set_on_new_(topic.subscription, &on_new, this);
  }
  TopicReader(const TopicReader&) = delete;
  TopicReader& operator=(const TopicReader&) = delete;
  ~TopicReader() {
    stop();
    std::free(message_.buffer);
  }

  // To be called before the subscriptions end. No interpreter may be held.
  void stop() {
    if (!thread_.joinable()) return;
    for (const Topic& topic : topics_) set_on_new_(topic.subscription, nullptr, nullptr);
    ring(true);
    thread_.join();
  }

  // From now on the runner takes the samples, those that wait first.
  void attach(Runner& runner) {
    const std::lock_guard<std::mutex> turn(turn_);
    runner_ = &runner;
    while (const tl::Arrived* sample = waiting_.front()) {
      hand(*sample);
      waiting_.release();
    }
  }

  // Waits at most so long [s] for a sample that waits for Python. No interpreter may be held.
  void wait(double seconds) {
    std::unique_lock<std::mutex> lock(come_lock_);
    come_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return !waiting_.empty(); });
  }
  // The samples that wait: arrival, sequence, time, signals, ages, one after the other.
  nb::list samples() {
    nb::list found;
    std::vector<double> numbers;
    while (const tl::Arrived* a = waiting_.front()) {
      numbers.assign({a->arrival, static_cast<double>(a->sequence), a->time});
      numbers.insert(numbers.end(), a->signals.begin(), a->signals.end());
      numbers.insert(numbers.end(), a->ages.begin(), a->ages.end());
      waiting_.release();
      found.append(arrays::line(numbers));
    }
    return found;
  }
  // What came since the last call: stream, time, arrival, valid, lost.
  nb::list notes() {
    nb::list found;
    while (const tl::TopicMerge::Note* n = merge_.notes().front()) {
      found.append(nb::make_tuple(n->stream, n->time, n->arrival, n->valid, n->lost));
      merge_.notes().release();
    }
    return found;
  }
  // Joint states that did not name all joints, before the first that did; the names seen in them. No
  // interpreter may be held.
  std::pair<std::size_t, std::vector<std::string>> incomplete() {
    const std::lock_guard<std::mutex> turn(turn_);
    return {merge_.incomplete(), merge_.seen()};
  }
  std::size_t overrun() const { return overrun_.load(); }

 private:
  static constexpr std::size_t kRoom = 1 << 14;  // bytes of a message, before memory is asked for
  static constexpr int kMost = 256;              // messages of a topic at once

  struct Topic {
    const void* subscription;
    std::uint64_t number = 0;          // of the last message
    std::uint8_t publisher[16] = {};  // that it is from
  };

  tl::Arrived blank() const {
    tl::Arrived made;
    made.signals.assign(3 * merge_.joints() + 6 * merge_.sensors(), 0.0);
    made.ages.assign(merge_.sensors(), 0.0);
    return made;
  }

  // In a thread of the middleware.
  static void on_new(const void* self, std::size_t) {
    const_cast<TopicReader*>(static_cast<const TopicReader*>(self))->ring(false);
  }
  void ring(bool stopping) {
    {
      const std::lock_guard<std::mutex> lock(bell_lock_);
      news_ = true;
      stopping_ = stopping_ || stopping;
    }
    bell_.notify_one();
  }

  void work() {
    go_ahead();
    while (true) {
      {
        std::unique_lock<std::mutex> lock(bell_lock_);
        const auto come = [this] { return news_; };
        const double patience = merge_.due() - tl::monotonic_seconds();
        if (patience < kLongest) {
          bell_.wait_for(lock, std::chrono::duration<double>(patience), come);
        } else {
          bell_.wait(lock, come);
        }
        if (stopping_) return;
        news_ = false;
      }
      const std::lock_guard<std::mutex> turn(turn_);
      bool more = false;
      const double looked = tl::monotonic_seconds();
      // Joint states first: the wrenches that belong to them have come by then.
      for (std::size_t t = 0; t < topics_.size(); ++t) more = all_of(t) || more;
      while (merge_.ready(looked)) hand_next();
      if (more) ring(false);
    }
  }

  // Takes what waits of a topic; true where there is more.
  bool all_of(std::size_t t) {
    Topic& topic = topics_[t];
    for (int i = 0; i < kMost; ++i) {
      if (t == 0 && merge_.full()) return true;
      RclInfo info{};
      message_.length = 0;
      if (take_(topic.subscription, &message_, &info, nullptr) != 0) return false;
      const double arrival = tl::monotonic_seconds();
      const int lost = lost_before(topic, info);
      if (t == 0) {
        merge_.joint_state(message_.buffer, message_.length, arrival, wall_seconds(), lost);
      } else {
        merge_.wrench(t - 1, message_.buffer, message_.length, arrival, wall_seconds(), lost);
      }
    }
    return true;
  }

  // How many messages of the same publisher did not come.
  static int lost_before(Topic& topic, const RclInfo& info) {
    const bool counted = info.published != ~std::uint64_t{0} && info.published != 0;
    const bool same = std::memcmp(topic.publisher, info.publisher, sizeof topic.publisher) == 0;
    const std::uint64_t before = topic.number;
    std::memcpy(topic.publisher, info.publisher, sizeof topic.publisher);
    topic.number = info.published;
    if (!counted || !same || before == 0 || info.published <= before) return 0;
    return static_cast<int>(std::min<std::uint64_t>(info.published - before - 1, kMostLost));
  }
  static constexpr std::uint64_t kMostLost = 1 << 30;
  static constexpr double kLongest = 1.0;  // [s] no joint state waits for so long

  void hand_next() {
    if (runner_ != nullptr) {
      const bool taken = runner_->push(merge_.time(), [this](tl::Arrived& slot) { merge_.take(slot); });
      if (!taken) merge_.take(scratch_);  // refused, or there was no room
      return;
    }
    tl::Arrived* slot = waiting_.vacant();
    merge_.take(slot != nullptr ? *slot : scratch_);
    if (slot == nullptr) {
      overrun_.fetch_add(1);
      return;
    }
    waiting_.publish();
    { const std::lock_guard<std::mutex> nobody_between_look_and_wait(come_lock_); }
    come_.notify_one();
  }
  void hand(const tl::Arrived& sample) {
    runner_->push(sample.time, [&sample](tl::Arrived& slot) { slot = sample; });
  }

  tl::TopicMerge merge_;
  RclTake take_;
  RclSetOnNew set_on_new_;
  std::vector<Topic> topics_;  // joint states, then one for each sensor
  RclBytes message_{};
  tl::Arrived scratch_;  // for what finds no room
  tl::Ring<tl::Arrived> waiting_;
  std::atomic<std::size_t> overrun_{0};
  std::mutex turn_;  // of the thread, or of who attaches
  Runner* runner_ = nullptr;
  std::mutex bell_lock_, come_lock_;
  std::condition_variable bell_, come_;
  bool news_ = false, stopping_ = false;
  std::thread thread_;  // last: it uses all of the others
};

// Writes one message as CDR, in the order of bytes of this machine (OMG DDS-XTypes 1.3, 7.4).
class CdrWriter {
 public:
  CdrWriter() {
    const std::uint16_t one = 1;
    const bool little = *reinterpret_cast<const std::uint8_t*>(&one) == 1;
    bytes_ = {0, static_cast<std::uint8_t>(little ? 1 : 0), 0, 0};
  }
  void word(std::uint32_t value) { put(&value, sizeof value); }
  void number(double value) { put(&value, sizeof value); }
  void text(std::string_view text) {
    word(static_cast<std::uint32_t>(text.size() + 1));
    bytes_.insert(bytes_.end(), text.begin(), text.end());
    bytes_.push_back(0);
  }
  void stamp(double time, std::string_view frame) {
    double seconds = std::floor(time), rest = std::nearbyint((time - seconds) * 1e9);
    if (rest >= 1e9) rest -= 1e9, seconds += 1.0;
    word(static_cast<std::uint32_t>(static_cast<std::int64_t>(seconds)));
    word(static_cast<std::uint32_t>(rest));
    text(frame);
  }
  void clear() { bytes_.resize(kHeader); }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  static constexpr std::size_t kHeader = 4;

  void put(const void* value, std::size_t size) {
    while ((bytes_.size() - kHeader) % size != 0) bytes_.push_back(0);
    const auto* from = static_cast<const std::uint8_t*>(value);
    bytes_.insert(bytes_.end(), from, from + size);
  }

  std::vector<std::uint8_t> bytes_;  // keeps its memory
};

// Contacts of one instant as JSON. Its text keeps its memory.
class ContactsJson {
 public:
  ContactsJson(const tl::Robot& robot) : robot_(robot) {}

  const std::string& write(const tl::Result& result) {
    text_.clear();
    text_ += "{\"time\": ";
    number(result.time);
    text_ += ", \"health\": " + std::to_string(static_cast<long long>(result.health));
    text_ += ", \"contacts\": [";
    bool first = true;
    for (const tl::Contact& c : result.contacts) {
      if (!first) text_ += ", ";
      first = false;
      contact(c);
    }
    text_ += "]}";
    return text_;
  }

 private:
  void contact(const tl::Contact& c) {
    text_ += "{\"event\": " + std::to_string(c.event);
    named(", \"segment\": ", c.segment < 0 ? nullptr : &robot_.segment_names[c.segment]);
    text_ += c.level == tl::ContactLevel::collision ? ", \"level\": \"collision\""
                                                    : ", \"level\": \"contact\"";
    text_ += ", \"status\": \"";
    text_ += fields::kStatuses[static_cast<std::size_t>(
        c.status == tl::Status::none ? tl::Status::wrench_only : c.status)];
    text_ += '"';
    const tl::Link* link = c.link < 0 ? nullptr : &robot_.links[c.link];
    named(", \"link\": ", link == nullptr ? nullptr : &link->name);
    named(", \"body\": ", link == nullptr ? nullptr : &link->body);
    text_ += ", \"body_probability\": ", number(c.body_probability);
    text_ += ", \"position\": ", vector(c.position);
    text_ += ", \"position_std\": ", number(c.position_std());
    text_ += ", \"covariance\": ";
    if (std::isnan(c.covariance[0])) {
      text_ += "null";
    } else {
      for (int i = 0; i < 3; ++i) {
        text_ += i == 0 ? "[" : ", ";
        vector({c.covariance[3 * i], c.covariance[3 * i + 1], c.covariance[3 * i + 2]});
      }
      text_ += ']';
    }
    text_ += ", \"force\": ", vector(c.force);
    text_ += ", \"candidates\": [";
    for (int i = 0; i < c.candidates.count; ++i) {
      const tl::PlaceCandidate& found = c.candidates.of[i];
      named(i == 0 ? "{\"link\": " : ", {\"link\": ", &robot_.links[found.link].name);
      text_ += ", \"probability\": ", number(found.probability);
      text_ += ", \"position\": ", vector(found.position);
      text_ += '}';
    }
    text_ += "]}";
  }
  void named(const char* key, const std::string* name) {
    text_ += key;
    if (name == nullptr) {
      text_ += "null";
      return;
    }
    text_ += '"';
    for (const char c : *name) {
      if (c == '"' || c == '\\') text_ += '\\';
      if (static_cast<unsigned char>(c) >= 0x20) text_ += c;
    }
    text_ += '"';
  }
  void vector(const tl::Vec3& v) {
    if (std::isnan(v.x)) {
      text_ += "null";
      return;
    }
    text_ += '[', number(v.x), text_ += ", ", number(v.y), text_ += ", ", number(v.z), text_ += ']';
  }
  void number(double value) {
    if (!std::isfinite(value)) {
      text_ += "null";
      return;
    }
    char digits[32];
    text_.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
  }

  const tl::Robot& robot_;
  std::string text_;
};

// Publishes what is felt from the thread that feels: contacts, torques, wrenches of segments.
class TopicWriter {
 public:
  // Publishers as rcl has them; `wrenches`: with the index of the segment.
  TopicWriter(const tl::Robot& robot, std::string frame, std::size_t publish, std::size_t contacts,
              std::size_t torques, const std::vector<std::pair<std::size_t, int>>& wrenches)
      : robot_(robot),
        frame_(std::move(frame)),
        publish_(reinterpret_cast<RclPublish>(publish)),
        contacts_(contacts),
        torques_(torques),
        wrenches_(wrenches),
        json_(robot_) {}

  void set_rate(double hz) { period_.store(1.0 / hz); }
  std::size_t published() const { return published_.load(); }  // samples
  std::size_t failed() const { return failed_.load(); }        // messages

  // Called in the thread that feels.
  void write(const tl::Sample& sample, const tl::Result& result) {
    const std::size_t n = robot_.joints.size();
    for (std::size_t j = 0; j < n; ++j)
      if (!std::isfinite(sample.q[j])) return;  // no honest estimate of it
    const double now = tl::monotonic_seconds(), period = period_.load();
    bool event = false;
    for (const tl::EventChange& change : result.events)
      event = event || change.happened != tl::Happened::changed;
    if (now < due_ && !event) return;
    due_ = std::max(due_, now - kBurst * period) + period;
    cdr_.clear();
    cdr_.text(json_.write(result));
    send(contacts_);
    cdr_.clear();
    cdr_.stamp(result.time, "");
    cdr_.word(static_cast<std::uint32_t>(n));
    for (const std::string& name : robot_.joint_names) cdr_.text(name);
    cdr_.word(0), cdr_.word(0);  // neither positions nor velocities
    numbers(result.estimate.tau_ext());
    send(torques_);
    for (const auto& [publisher, segment] : wrenches_) {
      cdr_.clear();
      cdr_.stamp(result.time, frame_);
      for (const double x : result.estimate.segment_wrench(segment)) cdr_.number(x);
      send(publisher);
    }
    published_.fetch_add(1);
  }

 private:
  static constexpr double kBurst = 2.0;  // periods that may be made up for: samples come with jitter

  void numbers(tl::Span<double> values) {
    cdr_.word(static_cast<std::uint32_t>(values.size()));
    for (const double x : values) cdr_.number(x);
  }
  void send(std::size_t publisher) {
    auto& bytes = const_cast<std::vector<std::uint8_t>&>(cdr_.bytes());
    const RclBytes message{bytes.data(), bytes.size(), bytes.capacity(), plain_memory()};
    if (publish_(reinterpret_cast<const void*>(publisher), &message, nullptr) != 0)
      failed_.fetch_add(1);
  }

  tl::Robot robot_;
  std::string frame_;
  RclPublish publish_;
  std::size_t contacts_, torques_;
  std::vector<std::pair<std::size_t, int>> wrenches_;
  ContactsJson json_;
  CdrWriter cdr_;
  std::atomic<double> period_{1e-3};  // [s] between samples that are published
  double due_ = 0.0;                  // [s] when the next may be
  std::atomic<std::size_t> published_{0}, failed_{0};
};

// What is felt is published by `writer` from now on, before Python sees it; None ends that.
inline void publish_with(pipelines::Pipeline& pipeline, TopicWriter* writer) {
  const guard::Turn turn(pipeline.turn);
  if (writer == nullptr) {
    pipeline.told = nullptr;
  } else {
    pipeline.told = [writer](const tl::Sample& s, const tl::Result& r) { writer->write(s, r); };
  }
}

inline void bind_ros(nb::module_& m) {
  nb::class_<TopicReader>(m, "TopicReader")
      .def(
          "__init__",
          [](TopicReader* self, std::vector<std::string> joints,
             const std::array<std::vector<double>, 3>& factors, std::vector<bool> measured,
             std::vector<std::array<double, 6>> axes, std::size_t take, std::size_t set_on_new,
             std::vector<std::size_t> subscriptions, std::size_t slots) {
            tl::TopicNames names{std::move(joints), {factors[0], factors[1], factors[2]},
                                 std::move(measured), std::move(axes)};
            new (self) TopicReader(std::move(names), take, set_on_new, std::move(subscriptions), slots);
          },
          "joints"_a, "factors"_a, "measured"_a, "axes"_a, "take"_a, "set_on_new"_a,
          "subscriptions"_a, "slots"_a)
      .def("attach", &TopicReader::attach, "runner"_a, nb::keep_alive<1, 2>(),
           nb::call_guard<nb::gil_scoped_release>())
      .def("wait", &TopicReader::wait, "seconds"_a, nb::call_guard<nb::gil_scoped_release>())
      .def("samples", &TopicReader::samples)
      .def("notes", &TopicReader::notes)
      .def("incomplete", &TopicReader::incomplete, nb::call_guard<nb::gil_scoped_release>())
      .def_prop_ro("overrun", &TopicReader::overrun)
      .def("stop", &TopicReader::stop, nb::call_guard<nb::gil_scoped_release>());
  nb::class_<TopicWriter>(m, "TopicWriter")
      .def(nb::init<const tl::Robot&, std::string, std::size_t, std::size_t, std::size_t,
                    const std::vector<std::pair<std::size_t, int>>&>(),
           "robot"_a, "frame"_a, "publish"_a, "contacts"_a, "torques"_a, "wrenches"_a)
      .def("set_rate", &TopicWriter::set_rate, "hz"_a)
      .def_prop_ro("published", &TopicWriter::published)
      .def_prop_ro("failed", &TopicWriter::failed);
  m.def("publish_with", &publish_with, "pipeline"_a, "writer"_a.none(), nb::keep_alive<1, 2>());
}

}  // namespace touchline::live
