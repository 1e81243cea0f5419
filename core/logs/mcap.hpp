// SPDX-License-Identifier: Apache-2.0
// Finds the messages in the records of an MCAP chunk (mcap.dev, version 0 of the format).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

namespace touchline::logs {

struct ChunkMessages {
  std::vector<std::int64_t> channel, received, start, size;
  bool damaged = false;  // something in the chunk could not be understood
};

template <class Word>
Word little_endian(const std::uint8_t* at) {
  Word value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

// Messages of the channels that `wanted` (65536 flags) names. Where the records make no sense the
// next message that `index` (increasing offsets, from the file's message indexes) tells is sought.
inline ChunkMessages find_messages(const std::uint8_t* data, std::size_t size,
                                   const std::uint8_t* wanted, const std::int64_t* index,
                                   std::size_t indexed) {
  constexpr std::size_t kRecord = 9;    // code and length of a record
  constexpr std::size_t kMessage = 22;  // channel, number, two times
  constexpr std::uint8_t kSchema = 3, kChannel = 4, kMessageCode = 5;
  ChunkMessages found;
  std::size_t at = 0;
  while (at < size) {
    bool good = size - at >= kRecord;
    std::uint64_t length = 0;
    if (good) {
      const std::uint8_t code = data[at];
      length = little_endian<std::uint64_t>(data + at + 1);
      good = (code == kSchema || code == kChannel || code == kMessageCode) &&
             length <= size - at - kRecord && (code != kMessageCode || length >= kMessage);
    }
    if (!good) {
      found.damaged = true;
      const std::int64_t* next =
          std::upper_bound(index, index + indexed, static_cast<std::int64_t>(at));
      if (next == index + indexed || static_cast<std::size_t>(*next) >= size) break;
      at = static_cast<std::size_t>(*next);
      continue;
    }
    const std::uint8_t* body = data + at + kRecord;
    if (data[at] == kMessageCode && wanted[little_endian<std::uint16_t>(body)]) {
      const auto time = little_endian<std::uint64_t>(body + 6);
      constexpr std::uint64_t last = std::numeric_limits<std::int64_t>::max();
      found.channel.push_back(little_endian<std::uint16_t>(body));
      found.received.push_back(static_cast<std::int64_t>(std::min(time, last)));
      found.start.push_back(static_cast<std::int64_t>(at + kRecord + kMessage));
      found.size.push_back(static_cast<std::int64_t>(length - kMessage));
    }
    at += kRecord + length;
  }
  return found;
}

}  // namespace touchline::logs
