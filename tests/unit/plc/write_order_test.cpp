#include "plc/write_order.hpp"

#include <algorithm>
#include <array>
#include <gtest/gtest.h>
#include <random>

/// A PLC's program may look at its registers between two writes, and between two words of one.
namespace binpick::plc {
namespace {
using Words = std::array<std::uint16_t, kMapLength>;
constexpr std::size_t kFlags = at("status");

bool has(const Words& words, std::uint16_t flag) { return (words[kFlags] & flag) != 0; }

Words random_words(std::mt19937& random) {
  Words words{};
  for (std::size_t i = kStatusFirst; i < kMapLength; ++i) words[i] = static_cast<std::uint16_t>(random() % 3);
  words[kFlags] = static_cast<std::uint16_t>(random() & 0x1FF);
  return words;
}
}  // namespace

TEST(WriteOrder, NothingIsWrittenWhereNothingDiffers) {
  Words words{};
  words[kFlags] = status::kReady;
  Words there = words;
  there[at("sequence")] = 7;  // the PLC's own
  EXPECT_FALSE(next_write(there, words, false).has_value());
}

TEST(WriteOrder, AResultGoesBeforeItsFlag) {
  Words there{}, ours{};
  there[kFlags] = status::kBusy;
  ours[kFlags] = status::kResultValid;
  ours[at("result_sequence")] = ours[at("result_sequence_tail")] = 5;
  auto write = next_write(there, ours, false);
  ASSERT_TRUE(write.has_value());
  EXPECT_EQ(write->first, kFlags);
  EXPECT_EQ(write->words, (std::vector<std::uint16_t>{0})) << "busy falls first";
  there[kFlags] = 0;
  write = next_write(there, ours, false);
  ASSERT_TRUE(write.has_value());
  EXPECT_EQ(write->first, kStatusFirst);
  ASSERT_EQ(write->words.size(), kStatusLength + kResultLength);
  EXPECT_EQ(write->words[kFlags - kStatusFirst], 0) << "not valid yet";
  std::ranges::copy(write->words, there.begin() + kStatusFirst);
  write = next_write(there, ours, false);
  ASSERT_TRUE(write.has_value());
  EXPECT_EQ(write->first, kFlags);
  EXPECT_EQ(write->words, (std::vector<std::uint16_t>{status::kResultValid}));
}

TEST(WriteOrder, AHeartbeatDisturbsNoFlag) {
  Words there{};
  there[kFlags] = status::kResultValid | status::kScanDone;
  there[at("result_sequence")] = there[at("result_sequence_tail")] = 5;
  Words ours = there;
  ++ours[at("cell_heartbeat")];
  const auto write = next_write(there, ours, false);
  ASSERT_TRUE(write.has_value());
  EXPECT_EQ(write->first, kStatusFirst);
  ASSERT_EQ(write->words.size(), kStatusLength);
  EXPECT_EQ(write->words[kFlags - kStatusFirst], there[kFlags]);
}

/// From any words to any others, seen after every single word: a flag stands only over words that it stood over
/// before, or over the new ones when all of them are there.
TEST(WriteOrder, NoFlagEverStandsOverHalfOfItsWords) {
  std::mt19937 random{20};
  for (int round = 0; round < 20'000; ++round) {
    const Words before = random_words(random);
    Words ours = random_words(random);
    if (round % 3 == 0) std::ranges::copy(before, ours.begin());
    if (round % 3 == 0) ours[random() % kStatusLength + kStatusFirst] ^= 1;
    const bool everything = round % 7 == 0;
    Words there = before;
    int writes = 0;
    bool all = !everything;
    while (const auto write = next_write(there, ours, !all)) {
      ASSERT_LE(++writes, 3);
      ASSERT_LE(write->words.size(), 123U);
      ASSERT_GE(write->first, kStatusFirst);
      all = all || write->words.size() == kStatusLength + kResultLength;
      // In either direction: nobody knows how a PLC copies.
      const std::size_t n = write->words.size();
      const bool forward = random() % 2 == 0;
      for (std::size_t i = 0; i < n; ++i) {
        const std::size_t k = forward ? i : n - 1 - i;
        there[write->first + k] = write->words[k];
        if (has(there, status::kResultValid)) {
          const auto same_as = [&](const Words& words) {
            return std::equal(there.begin() + kResultFirst, there.end(), words.begin() + kResultFirst);
          };
          ASSERT_TRUE((same_as(before) && has(before, status::kResultValid)) || same_as(ours));
        }
        // A flag that neither stood nor has to stand is never seen; one that rises, only over all the new words.
        ASSERT_EQ(there[kFlags] & ~(before[kFlags] | ours[kFlags]), 0);
        if ((there[kFlags] & ~before[kFlags]) != 0) {
          ASSERT_TRUE(std::equal(there.begin() + kStatusFirst, there.end(), ours.begin() + kStatusFirst));
        }
        // One that falls has fallen before any word of the new ones is there.
        if ((there[kFlags] & ~ours[kFlags]) != 0) {
          ASSERT_TRUE(std::equal(there.begin() + kStatusFirst, there.end(), before.begin() + kStatusFirst));
        }
      }
    }
    ASSERT_TRUE(std::equal(there.begin() + kStatusFirst, there.end(), ours.begin() + kStatusFirst));
    ASSERT_TRUE(all);
  }
}
}  // namespace binpick::plc
