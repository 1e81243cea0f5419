// SPDX-License-Identifier: Apache-2.0
// What can be wrong with one channel, and where the channels of a robot stand.
// Theory: docs/theory.md, section 3.
#pragma once

#include <cstddef>
#include <cstdint>

namespace touchline {

// Of one channel in one sample. A `spike` is a jump that no other channel bears out: the last good
// reading stands for it. With the others the channel is left out, as if it were NaN.
enum class Fault : std::uint8_t {
  none,
  spike,     // one to a few samples far from those before
  step,      // such a jump to a level that stays, and a sensor that must feel it feels nothing
  wild,      // such jumps that go on
  stuck,     // the same value again and again while the arm moves
  // Position or velocity of a joint: one is not the derivative of the other. Axis of a sensor:
  // what it shows, another one that would have to feel it too does not.
  disagrees,
  // It alone explains what is felt, but so would a contact, at one place in thousands: it counts on,
  // and no contact is sure.
  suspect,
  absent      // position or velocity of a joint: not there, the other one stands in for it
};

// Channels in the order of a sample: q, qd and tau of all joints, then six of each sensor.
struct ChannelLayout {
  std::size_t joints, sensors;
  std::size_t q() const { return 0; }
  std::size_t qd() const { return joints; }
  std::size_t tau() const { return 2 * joints; }
  std::size_t wrench() const { return 3 * joints; }
  std::size_t count() const { return 3 * joints + 6 * sensors; }
};

}  // namespace touchline
