// SPDX-License-Identifier: Apache-2.0
// Reads sensor_msgs/JointState and geometry_msgs/WrenchStamped where they stand in a file.
//
// The encoding is that of OMG's CDR (DDS-XTypes 1.3, section 7.4): numbers aligned to their size,
// counted from behind the header of four bytes, in the byte order that the header tells. Every
// length is checked against what is left of the message before it is used, so that a damaged one
// costs the message and nothing else.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <unordered_set>
#include <utility>
#include <vector>

namespace touchline::logs {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// The bytes in the other order.
template <class Integer>
Integer swapped(Integer value) {
  Integer turned = 0;
  for (std::size_t i = 0; i < sizeof value; ++i) {
    turned = static_cast<Integer>(turned << 8 | (value >> (8 * i) & 0xff));
  }
  return turned;
}

// Steps through one message. After the first thing that does not fit `good()` is false, and all
// that is read from then on is 0 or empty.
class CdrReader {
 public:
  CdrReader(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {
    // Plain CDR (0, 1) and plain CDR2 (6, 7), which aligns to four bytes at most.
    if (size < kHeader || data[0] != 0) { fail(); return; }
    const std::uint8_t kind = data[1];
    if (kind > 1 && kind != 6 && kind != 7) { fail(); return; }
    little_ = (kind & 1) != 0;
    widest_ = kind > 1 ? 4 : 8;
    at_ = kHeader;
  }

  bool good() const { return good_; }

  std::uint32_t word() {
    align(4);
    if (!fits(4)) return 0;
    std::uint32_t value;
    std::memcpy(&value, data_ + at_, 4);
    at_ += 4;
    return little_ ? value : swapped(value);
  }

  std::string_view text() {
    const std::size_t length = word();  // with the zero at the end
    if (!fits(length)) return {};
    const char* start = reinterpret_cast<const char*>(data_ + at_);
    at_ += length;
    return {start, length == 0 ? 0 : length - 1};
  }

  // How many items follow, of at least `least` bytes each.
  std::size_t count(std::size_t least) {
    const std::size_t items = word();
    return fits(items * least) ? items : 0;
  }

  // Where so many doubles stand; they are read by `number`.
  const std::uint8_t* doubles(std::size_t items) {
    if (items == 0) return data_;  // an empty sequence is not aligned
    align(widest_);
    if (!fits(8 * items)) return nullptr;
    const std::uint8_t* start = data_ + at_;
    at_ += 8 * items;
    return start;
  }

  double number(const std::uint8_t* where) const {
    std::uint64_t bits;
    std::memcpy(&bits, where, 8);
    if (!little_) bits = swapped(bits);
    double value;
    std::memcpy(&value, &bits, 8);
    return value;
  }

  // The header of a stamped message: its stamp [s].
  double stamp() {
    const auto seconds = static_cast<std::int32_t>(word());
    const double nanoseconds = word();
    text();  // the frame
    return seconds + nanoseconds * 1e-9;
  }

  std::size_t at() const { return at_; }
  void skip_to(std::size_t at) { at_ = at; }
  const std::uint8_t* data() const { return data_; }
  std::size_t left() const { return size_ - at_; }

 private:
  static constexpr std::size_t kHeader = 4;

  void fail() { good_ = false; }

  bool fits(std::size_t bytes) {
    if (good_ && (at_ > size_ || bytes > size_ - at_)) fail();
    return good_;
  }

  void align(std::size_t to) { at_ += (to - (at_ - kHeader) % to) % to; }

  const std::uint8_t* data_;
  std::size_t size_, at_ = 0, widest_ = 8;
  bool good_ = true, little_ = true;
};

inline bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<std::uint8_t>(text[i]);
    const std::size_t more = lead < 0x80 ? 0 : lead >= 0xF0 ? 3 : lead >= 0xE0 ? 2 : 1;
    if ((lead >= 0x80 && lead < 0xC2) || lead > 0xF4 || i + more >= text.size()) return false;
    for (std::size_t k = 1; k <= more; ++k)
      if ((static_cast<std::uint8_t>(text[i + k]) & 0xC0) != 0x80) return false;
    // Overlong forms, halves of surrogates, and what lies beyond the last code point.
    const auto second = static_cast<std::uint8_t>(more ? text[i + 1] : 0);
    if ((lead == 0xE0 && second < 0xA0) || (lead == 0xED && second > 0x9F) ||
        (lead == 0xF0 && second < 0x90) || (lead == 0xF4 && second > 0x8F))
      return false;
    i += more + 1;
  }
  return true;
}

// One joint state in the order of the wanted joints; NaN where the message lacks a value.
struct JointStateRow {
  double* stamp;
  double* position;
  double* velocity;
  double* effort;
  bool* complete;  // the message names every wanted joint
};

class JointStateDecoder {
 public:
  explicit JointStateDecoder(std::vector<std::string> joints) : joints_(std::move(joints)) {}

  std::size_t width() const { return joints_.size(); }
  const std::vector<std::string>& seen() const { return seen_; }

  // False where the message is damaged; the row is then left as it was.
  bool decode(const std::uint8_t* data, std::size_t size, const JointStateRow& row) {
    CdrReader reader(data, size);
    const double stamp = reader.stamp();
    if (!reader.good() || !names(reader)) return false;
    double* const targets[3] = {row.position, row.velocity, row.effort};
    const std::uint8_t* starts[3];
    std::size_t counts[3];
    for (int k = 0; k < 3; ++k) {
      counts[k] = reader.count(8);
      starts[k] = reader.doubles(counts[k]);
    }
    if (!reader.good()) return false;
    *row.stamp = stamp;
    *row.complete = complete_;
    if (!complete_) return true;
    for (int k = 0; k < 3; ++k) {
      if (counts[k] != named_) continue;
      for (std::size_t j = 0; j < order_.size(); ++j)
        targets[k][j] = reader.number(starts[k] + 8 * order_[j]);
    }
    return true;
  }

 private:
  static constexpr std::size_t kMostNames = 1000;  // that are remembered, of a damaged recording

  // Takes the list of names. It is nearly always the same one as before, byte by byte.
  bool names(CdrReader& reader) {
    reader.skip_to(reader.at() + (4 - reader.at() % 4) % 4);
    if (!list_.empty() && reader.left() >= list_.size() &&
        std::memcmp(reader.data() + reader.at(), list_.data(), list_.size()) == 0) {
      reader.skip_to(reader.at() + list_.size());
      return true;
    }
    list_.clear();
    const std::size_t start = reader.at();
    const std::size_t count = reader.count(4);
    std::vector<std::string_view> found;
    for (std::size_t i = 0; i < count && reader.good(); ++i) found.push_back(reader.text());
    if (!reader.good()) return false;
    for (const std::string_view name : found)
      if (!is_utf8(name)) return false;
    for (const std::string_view name : found)
      if (seen_.size() < kMostNames && known_.insert(std::string(name)).second)
        seen_.emplace_back(name);
    named_ = count;
    order_.clear();
    for (const std::string& joint : joints_)
      for (std::size_t i = 0; i < count; ++i)
        if (found[i] == joint) {
          order_.push_back(i);
          break;
        }
    complete_ = order_.size() == joints_.size();
    list_.assign(reader.data() + start, reader.data() + reader.at());
    return true;
  }

  std::vector<std::string> joints_, seen_;
  std::unordered_set<std::string> known_;
  std::vector<std::uint8_t> list_;  // the last list of names, as its bytes
  std::size_t named_ = 0;
  std::vector<std::size_t> order_;  // where the wanted joints stand in it
  bool complete_ = false;
};

// Force and moment; false where the message is damaged.
inline bool decode_wrench(const std::uint8_t* data, std::size_t size, double* stamp,
                          double* wrench) {
  CdrReader reader(data, size);
  const double found = reader.stamp();
  const std::uint8_t* start = reader.doubles(6);
  if (!reader.good()) return false;
  *stamp = found;
  for (int i = 0; i < 6; ++i) wrench[i] = reader.number(start + 8 * i);
  return true;
}

}  // namespace touchline::logs
