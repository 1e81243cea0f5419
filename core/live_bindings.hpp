// SPDX-License-Identifier: Apache-2.0
// A pipeline that runs beside Python: packages of a socket become samples in one thread, samples
// become results in another, and Python takes both when it has time.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#if defined(__unix__) || defined(__APPLE__)
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>
#define TOUCHLINE_SOCKETS 1
#endif

#ifdef __linux__
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#endif

#include "arrays.hpp"
#include "pipeline_bindings.hpp"
#include "touchline/live.hpp"

namespace touchline::live {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;

// Threads that read and feel go before what else the machine does, Python's work above all: they
// have real-time priority where the system lets this user have it. That is this one (1 to 99), below
// a control loop's own (libfranka asks for the highest) and below the kernel's interrupts (50).
constexpr int kRealTime = 10;
// Elsewhere this niceness (that of PipeWire's threads), where the system grants at least that.
constexpr int kAhead = -11;

// Sets the priority of the calling thread; its children do not inherit it. A real-time priority that
// the user gave the program stays. True if the thread's is real-time.
inline bool go_ahead() noexcept {
#ifdef __linux__
  const int policy = ::sched_getscheduler(0) & ~SCHED_RESET_ON_FORK;
  if (policy == SCHED_FIFO || policy == SCHED_RR) return true;
  sched_param wanted{};
  wanted.sched_priority = kRealTime;
  if (::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &wanted) == 0) return true;
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::syscall(SYS_gettid)), kAhead);
#endif
  return false;
}

// A pipeline in a thread of its own. Python takes of each sample: arrival, sequence, time, signals,
// ages, then the pipeline's snapshot.
class Runner {
 public:
  Runner(pipelines::Pipeline& pipeline, std::size_t slots)
      : pipeline_(pipeline),
        joints_(pipeline.value->robot().joints.size()),
        sensors_(pipeline.value->robot().sensors.size()),
        results_(slots, std::vector<double>()),
        runner_(joints_, sensors_, slots, [this](const tl::Arrived& a) { take(a); }) {}

  std::size_t joints() const { return joints_; }
  std::size_t sensors() const { return sensors_; }

  template <class Fill>
  bool push(double time, Fill&& fill) {
    const tl::Admission::Verdict verdict = admission_.take(time);
    if (verdict == tl::Admission::Verdict::refused) {
      refused_.fetch_add(1);
      return false;
    }
    return runner_.push(fill);
  }

  // All results there are, one list of numbers each.
  nb::list results() {
    nb::list found;
    while (const std::vector<double>* numbers = results_.front()) {
      found.append(arrays::line(*numbers));
      results_.release();
    }
    return found;
  }
  // Waits at most so long [s] for a result; whether there is one. No interpreter may be held.
  bool wait(double seconds) {
    std::unique_lock<std::mutex> lock(waiting_);
    return come_.wait_for(lock, std::chrono::duration<double>(seconds),
                          [this] { return !results_.empty(); });
  }

  std::size_t refused() const { return refused_.load(); }
  std::size_t unseen() const { return unseen_.load(); }
  std::size_t overrun() const { return runner_.overrun(); }
  std::size_t taken() const { return runner_.taken(); }
  double longest_gap() { return runner_.longest_gap(); }
  void stop() { runner_.stop(); }

 private:
  void take(const tl::Arrived& arrived) {
    if (!ahead_) go_ahead();
    ahead_ = true;
    const std::lock_guard<std::mutex> turn(pipeline_.turn);  // no interpreter is held here
    const tl::Sample sample = arrived.sample(joints_);
    const tl::Result result = pipeline_.value->update(sample);
    if (pipeline_.told) pipeline_.told(sample, result);
    pipelines::keep_ended(pipeline_, result);
    std::vector<double>* out = results_.vacant();
    if (out == nullptr) {
      unseen_.fetch_add(1);
      return;
    }
    snapshot_.resize(pipelines::size_of_snapshot(pipeline_, result));
    pipelines::take_snapshot(pipeline_, sample, result, snapshot_.data());
    out->clear();
    out->push_back(arrived.arrival);
    out->push_back(static_cast<double>(arrived.sequence));
    out->push_back(arrived.time);
    out->insert(out->end(), arrived.signals.begin(), arrived.signals.end());
    out->insert(out->end(), arrived.ages.begin(), arrived.ages.end());
    out->insert(out->end(), snapshot_.begin(), snapshot_.end());
    results_.publish();
    { const std::lock_guard<std::mutex> nobody_between_look_and_wait(waiting_); }
    come_.notify_one();
  }

  pipelines::Pipeline& pipeline_;
  std::size_t joints_, sensors_;
  tl::Ring<std::vector<double>> results_;
  std::vector<double> snapshot_;
  bool ahead_ = false;  // of the thread that feels
  tl::Admission admission_;
  std::atomic<std::size_t> refused_{0}, unseen_{0};
  std::mutex waiting_;
  std::condition_variable come_;
  tl::Runner runner_;  // last: its thread uses all of the others
};

#ifdef TOUCHLINE_SOCKETS

// A thread that reads a socket until that ends, and gives all bytes that wait to `take`.
class SocketReader {
 public:
  explicit SocketReader(int socket) : socket_(::dup(socket)) {}
  SocketReader(const SocketReader&) = delete;
  SocketReader& operator=(const SocketReader&) = delete;
  ~SocketReader() { stop(); }

  // `take(bytes, now)` erases from the front of `bytes` what it has used; false where they are not
  // what was expected, which ends the thread with `wrong`.
  template <class Take>
  void start(std::vector<unsigned char> begun, const char* wrong, Take take) {
    thread_ = std::thread([this, bytes = std::move(begun), wrong, take]() mutable {
      work(bytes, wrong, take);
    });
  }

  void stop() {
    stopping_.store(true);
    if (thread_.joinable()) thread_.join();
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }
  // Empty while all is well.
  std::string fault() const { return ended_.load() ? fault_ : std::string(); }

 private:
  static constexpr int kPatience = 20;         // [ms] after which the thread looks whether it shall end
  static constexpr std::size_t kRead = 1 << 16;  // bytes at once

  template <class Take>
  void work(std::vector<unsigned char>& bytes, const char* wrong, Take& take) {
    go_ahead();
    std::vector<unsigned char> read(kRead);
    while (!stopping_.load()) {
      if (!take(bytes, tl::monotonic_seconds())) return end(wrong);
      pollfd wait{socket_, POLLIN, 0};
      if (::poll(&wait, 1, kPatience) <= 0) continue;
      const ssize_t got = ::recv(socket_, read.data(), read.size(), MSG_DONTWAIT);
      if (got == 0) return end("it has closed the connection");
      if (got < 0 && errno != EAGAIN && errno != EINTR) return end(std::strerror(errno));
      if (got > 0) bytes.insert(bytes.end(), read.begin(), read.begin() + got);
    }
  }

  void end(std::string why) {
    fault_ = std::move(why);
    ended_.store(true);
  }

  int socket_;
  std::atomic<bool> stopping_{false}, ended_{false};
  std::string fault_;  // written before `ended_` is set
  std::thread thread_;
};

inline std::vector<unsigned char> bytes_of(const std::string& text) {
  return {text.begin(), text.end()};
}

// Where the fields of an RTDE data package stand, in bytes behind its head; -1: not there.
struct RtdeLayout {
  int recipe = 0;
  std::size_t size = 0;  // of the payload, the recipe's number included
  int time = -1, q = -1, qd = -1, tau = -1, wrench = -1;
  std::vector<bool> measured;  // which joints have a torque signal
  double frequency = 500.0;    // [Hz], by which samples are counted
  double first = 0.0;          // [s] the stamp of number 0
};

// Reads the data packages of a controller in a thread of its own, until the socket ends.
class RtdeReader {
 public:
  RtdeReader(Runner& runner, int socket, RtdeLayout layout, const std::string& begun)
      : runner_(runner), layout_(std::move(layout)), reader_(socket) {
    reader_.start(bytes_of(begun), "it sends no RTDE any more",
                  [this](std::vector<unsigned char>& bytes, double now) {
                    return packages(bytes, now);
                  });
  }

  void stop() { reader_.stop(); }
  std::string fault() const { return reader_.fault(); }

 private:
  static constexpr std::size_t kLongest = 4096;  // bytes of a package
  static constexpr unsigned char kData = 'U';

  // Takes whole packages from the front; false where they are none of RTDE.
  bool packages(std::vector<unsigned char>& bytes, double now) {
    std::size_t at = 0;
    bool good = true;
    while (good && bytes.size() - at >= 3) {
      const std::size_t size = bytes[at] * 256u + bytes[at + 1];
      if (size < 3 || size > kLongest) good = false;
      if (!good || bytes.size() - at < size) break;
      const unsigned char* payload = bytes.data() + at + 3;
      if (bytes[at + 2] == kData && size - 3 == layout_.size && payload[0] == layout_.recipe)
        sample(payload, now);
      at += size;
    }
    bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
    return good;
  }

  static double number(const unsigned char* bytes) {
    std::uint64_t bits = 0;
    for (int i = 0; i < 8; ++i) bits = bits << 8 | bytes[i];
    double value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

  // A time [s] on whole nanoseconds, to the bits of touchline.live.sample.on_nanoseconds.
  static double on_nanoseconds(double time) {
    double seconds = std::floor(time), rest = std::nearbyint((time - seconds) * 1e9);
    if (rest >= 1e9) rest -= 1e9, seconds += 1.0;
    return seconds + rest * 1e-9;
  }

  void sample(const unsigned char* payload, double now) {
    const double time = on_nanoseconds(number(payload + layout_.time));
    runner_.push(time, [&](tl::Arrived& slot) {
      slot.arrival = now;
      slot.time = time;
      slot.sequence = std::llround((time - layout_.first) * layout_.frequency);
      const std::size_t n = runner_.joints();
      double* out = slot.signals.data();
      out = copy(payload, layout_.q, n, out);
      out = copy(payload, layout_.qd, n, out);
      double* const tau = out;
      out = copy(payload, layout_.tau, n, out);
      for (std::size_t j = 0; j < n; ++j)
        if (!layout_.measured[j]) tau[j] = tl::kUnknown;
      copy(payload, layout_.wrench, 6 * runner_.sensors(), out);
    });
  }

  static double* copy(const unsigned char* payload, int offset, std::size_t count, double* out) {
    for (std::size_t i = 0; i < count; ++i)
      *out++ = offset < 0 ? tl::kUnknown : number(payload + offset + 8 * i);
    return out;
  }

  Runner& runner_;
  RtdeLayout layout_;
  SocketReader reader_;  // last: its thread uses the others
};

// Reads the samples of another process of this machine, and keeps what else it tells: frames of
// size (4 bytes), kind (1 byte) and payload, in this machine's byte order. A sample's payload is
// sequence, arrival, time, signals and ages as doubles.
class FrameReader {
 public:
  FrameReader(Runner& runner, int socket, const std::string& begun) : runner_(runner), reader_(socket) {
    reader_.start(bytes_of(begun), "the reading process has sent something else than frames",
                  [this](std::vector<unsigned char>& bytes, double) { return frames(bytes); });
  }

  void stop() { reader_.stop(); }
  std::string fault() const { return reader_.fault(); }

  // What else was told since the last call: kind and payload, one after the other.
  nb::list told() {
    std::vector<std::vector<unsigned char>> told;
    {
      const std::lock_guard<std::mutex> lock(telling_);
      told.swap(told_);
    }
    nb::list out;
    for (const std::vector<unsigned char>& frame : told)
      out.append(nb::bytes(reinterpret_cast<const char*>(frame.data()), frame.size()));
    return out;
  }

 private:
  static constexpr std::size_t kHead = 4, kLongest = 1 << 20;  // bytes
  static constexpr std::size_t kMostTold = 4096;  // frames that wait for Python
  static constexpr unsigned char kSample = 'S';

  // Takes whole frames from the front; false where they are none.
  bool frames(std::vector<unsigned char>& bytes) {
    std::size_t at = 0;
    bool good = true;
    while (good && bytes.size() - at >= kHead) {
      std::uint32_t size;
      std::memcpy(&size, bytes.data() + at, kHead);
      good = size >= 1 && size <= kLongest;
      if (!good || bytes.size() - at - kHead < size) break;
      const unsigned char* frame = bytes.data() + at + kHead;
      good = frame[0] != kSample ? tell(frame, size) : sample(frame + 1, size - 1);
      at += kHead + size;
    }
    bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
    return good;
  }

  bool tell(const unsigned char* frame, std::size_t size) {
    const std::lock_guard<std::mutex> lock(telling_);
    if (told_.size() == kMostTold) told_.erase(told_.begin());
    told_.emplace_back(frame, frame + size);
    return true;
  }

  bool sample(const unsigned char* payload, std::size_t size) {
    const std::size_t signals = 3 * runner_.joints() + 6 * runner_.sensors();
    if (size != sizeof(double) * (3 + signals + runner_.sensors())) return false;
    double head[3];
    std::memcpy(head, payload, sizeof head);
    runner_.push(head[2], [&](tl::Arrived& slot) {
      slot.sequence = std::llround(head[0]);
      slot.arrival = head[1];
      slot.time = head[2];
      std::memcpy(slot.signals.data(), payload + sizeof head, sizeof(double) * signals);
      std::memcpy(slot.ages.data(), payload + sizeof head + sizeof(double) * signals,
                  sizeof(double) * runner_.sensors());
    });
    return true;
  }

  Runner& runner_;
  std::mutex telling_;
  std::vector<std::vector<unsigned char>> told_;
  SocketReader reader_;  // last: its thread uses the others
};

#endif

inline int admit(tl::Admission& admission, double time) {
  return static_cast<int>(admission.take(time));
}

inline void bind(nb::module_& m) {
  m.def("go_ahead", &go_ahead,
        "Gives the calling thread real-time priority, or else a niceness of -11, as the system lets this\n"
        "user have it. Returns whether it is real-time.");
  nb::class_<tl::Admission>(m, "Admission").def(nb::init<>()).def("take", &admit, "time"_a);
  nb::class_<Runner>(m, "Runner")
      .def(nb::init<pipelines::Pipeline&, std::size_t>(), "pipeline"_a, "slots"_a,
           nb::keep_alive<1, 2>())
      .def("results", &Runner::results)
      .def("wait", &Runner::wait, "seconds"_a, nb::call_guard<nb::gil_scoped_release>())
      .def_prop_ro("refused", &Runner::refused)
      .def_prop_ro("unseen", &Runner::unseen)
      .def_prop_ro("overrun", &Runner::overrun)
      .def_prop_ro("taken", &Runner::taken)
      .def("longest_gap", &Runner::longest_gap)
      .def("stop", &Runner::stop, nb::call_guard<nb::gil_scoped_release>());
#ifdef TOUCHLINE_SOCKETS
  nb::class_<RtdeLayout>(m, "RtdeLayout")
      .def(nb::init<>())
      .def_rw("recipe", &RtdeLayout::recipe)
      .def_rw("size", &RtdeLayout::size)
      .def_rw("time", &RtdeLayout::time)
      .def_rw("q", &RtdeLayout::q)
      .def_rw("qd", &RtdeLayout::qd)
      .def_rw("tau", &RtdeLayout::tau)
      .def_rw("wrench", &RtdeLayout::wrench)
      .def_rw("measured", &RtdeLayout::measured)
      .def_rw("frequency", &RtdeLayout::frequency)
      .def_rw("first", &RtdeLayout::first);
  nb::class_<RtdeReader>(m, "RtdeReader")
      .def(
          "__init__",
          [](RtdeReader* self, Runner& runner, int socket, const RtdeLayout& layout,
             const nb::bytes& begun) {
            new (self) RtdeReader(runner, socket, layout, std::string(begun.c_str(), begun.size()));
          },
          "runner"_a, "socket"_a, "layout"_a, "begun"_a, nb::keep_alive<1, 2>())
      .def_prop_ro("fault", &RtdeReader::fault)
      .def("stop", &RtdeReader::stop, nb::call_guard<nb::gil_scoped_release>());
  nb::class_<FrameReader>(m, "FrameReader")
      .def(
          "__init__",
          [](FrameReader* self, Runner& runner, int socket, const nb::bytes& begun) {
            new (self) FrameReader(runner, socket, std::string(begun.c_str(), begun.size()));
          },
          "runner"_a, "socket"_a, "begun"_a, nb::keep_alive<1, 2>())
      .def("told", &FrameReader::told)
      .def_prop_ro("fault", &FrameReader::fault)
      .def("stop", &FrameReader::stop, nb::call_guard<nb::gil_scoped_release>());
#endif
}

}  // namespace touchline::live
