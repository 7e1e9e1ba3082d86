#include "drivers/scanner/lps36/codec.hpp"

#include <algorithm>
#include <bit>
#include <iterator>

namespace binpick::drivers::lps36 {
namespace {
constexpr std::uint16_t kStart = 0xFFFF;
constexpr std::size_t kIdByte = 6, kPacketByte = 10, kTransactionByte = 14, kStatusByte = 16, kEncoderHighByte = 18,
                      kEncoderLowByte = 20, kScanByte = 24, kTypeByte = 26, kCountByte = 28;
/// Public drivers differ: LXSG takes nothing else than 0 there, and ran on a real sensor; NODE does not look.
constexpr std::size_t kFillBytes[] = {4, 8, 12, 22};
constexpr std::size_t kParameterHeadWords = 8;

DecodeError error(DecodeError::Kind kind, std::size_t at) { return {kind, at}; }

std::uint16_t low(std::uint32_t value) { return static_cast<std::uint16_t>(value & 0xFFFF); }
std::uint16_t high(std::uint32_t value) { return static_cast<std::uint16_t>(value >> 16); }
std::uint32_t joined(std::uint16_t high, std::uint16_t low) { return std::uint32_t{high} << 16 | low; }
std::int16_t signed_of(std::uint16_t word) { return std::bit_cast<std::int16_t>(word); }
std::uint16_t word_of(std::int16_t value) { return std::bit_cast<std::uint16_t>(value); }

Telegram with_words(Id id, std::vector<std::uint16_t> words) {
  Telegram telegram = command(id);
  telegram.words = std::move(words);
  return telegram;
}
}  // namespace

std::optional<Mode> Status::mode() const {
  const std::uint16_t mode = bits & 0x00F0;
  if (!std::has_single_bit(mode)) return std::nullopt;
  return static_cast<Mode>(mode);
}

std::string to_string(const DecodeError& error) {
  using Kind = DecodeError::Kind;
  const auto what = [&]() -> const char* {
    switch (error.kind) {
      case Kind::TooShort:
        return "datagram shorter than a header";
      case Kind::BadStart:
        return "datagram does not begin as a telegram";
      case Kind::BadFill:
        return "header word that has to be 0 is not";
      case Kind::BadType:
        return "unknown type of content";
      case Kind::BadLength:
        return "stated and real length differ";
      case Kind::BadContent:
        return "content does not fit the telegram";
    }
    return "?";
  }();
  return std::string{what} + " (byte " + std::to_string(error.at) + ")";
}

Expected<Telegram, DecodeError> decode(ByteView datagram) {
  using Kind = DecodeError::Kind;
  if (datagram.size() < kHeaderBytes) return unexpected(error(Kind::TooShort, datagram.size()));
  const auto word = [&](std::size_t at) { return read_le<std::uint16_t>(datagram, at); };
  for (const std::size_t at : {std::size_t{0}, std::size_t{2}})
    if (word(at) != kStart) return unexpected(error(Kind::BadStart, at));
  for (const std::size_t at : kFillBytes)
    if (word(at) != 0) return unexpected(error(Kind::BadFill, at));
  Telegram telegram;
  telegram.id = static_cast<Id>(word(kIdByte));
  telegram.packet_number = word(kPacketByte);
  telegram.transaction = word(kTransactionByte);
  telegram.status.bits = word(kStatusByte);
  telegram.encoder = joined(word(kEncoderHighByte), word(kEncoderLowByte));
  telegram.scan = word(kScanByte);
  telegram.type = word(kTypeByte);
  if (telegram.type != kTypeWords && telegram.type != 0) return unexpected(error(Kind::BadType, kTypeByte));
  const std::size_t count = word(kCountByte);
  if (count > kWordsMax || datagram.size() != kHeaderBytes + 2 * count)
    return unexpected(error(Kind::BadLength, kCountByte));
  telegram.words.reserve(count);
  for (std::size_t i = 0; i < count; ++i) telegram.words.push_back(word(kHeaderBytes + 2 * i));
  return telegram;
}

Bytes encode(const Telegram& telegram) {
  constexpr std::uint16_t fill = 0;
  Bytes out;
  out.reserve(kHeaderBytes + 2 * telegram.words.size());
  for (const std::uint16_t word :
       {kStart, kStart, fill, static_cast<std::uint16_t>(telegram.id), fill, telegram.packet_number, fill,
        telegram.transaction, telegram.status.bits, high(telegram.encoder), low(telegram.encoder), fill, telegram.scan,
        telegram.type, static_cast<std::uint16_t>(telegram.words.size())})
    append_le(out, word);
  for (const std::uint16_t word : telegram.words) append_le(out, word);
  return out;
}

bool is_measured(Id id) { return id == Id::MeasuredZ || id == Id::MeasuredX || id == Id::MeasuredZx; }

Expected<Measured, DecodeError> measured_of(const Telegram& telegram) {
  const auto wrong = error(DecodeError::Kind::BadContent, kCountByte);
  if (!is_measured(telegram.id)) return unexpected(error(DecodeError::Kind::BadContent, kIdByte));
  Measured measured;
  measured.status = telegram.status;
  measured.encoder = telegram.encoder;
  measured.scan = telegram.scan;
  const auto& words = telegram.words;
  if (telegram.id == Id::MeasuredZx) {
    if (words.size() != 2 * kPointsHi) return unexpected(wrong);
    measured.part = Measured::Part::Both;
    const auto middle = words.begin() + kPointsHi;
    measured.z.assign(words.begin(), middle);
    std::transform(middle, words.end(), std::back_inserter(measured.x), signed_of);
    return measured;
  }
  if (words.size() != kPoints) return unexpected(wrong);
  if (telegram.id == Id::MeasuredZ) {
    measured.part = Measured::Part::Z;
    measured.z = words;
  } else {
    measured.part = Measured::Part::X;
    std::ranges::transform(words, std::back_inserter(measured.x), signed_of);
  }
  return measured;
}

Telegram telegram_of(const Measured& measured) {
  using Part = Measured::Part;
  Telegram telegram;
  telegram.id = measured.part == Part::Z ? Id::MeasuredZ : measured.part == Part::X ? Id::MeasuredX : Id::MeasuredZx;
  telegram.status = measured.status;
  telegram.encoder = measured.encoder;
  telegram.scan = measured.scan;
  telegram.words = measured.z;
  std::ranges::transform(measured.x, std::back_inserter(telegram.words), word_of);
  return telegram;
}

Telegram command(Id id) {
  Telegram telegram;
  telegram.id = id;
  return telegram;
}
Telegram connect(bool hi) { return hi ? with_words(Id::Connect, {1}) : command(Id::Connect); }
Telegram activate(bool on) { return with_words(Id::Activate, {on}); }
Telegram set_laser(bool on) { return with_words(Id::SetLaser, {on}); }
Telegram set_encoder(std::uint32_t value) { return with_words(Id::SetEncoder, {low(value), high(value)}); }
Telegram set_task(std::uint16_t task, bool permanent) { return with_words(Id::SetTask, {task, permanent}); }
Telegram set_scan_number(std::uint16_t scan) { return with_words(Id::SetScanNumber, {scan}); }
Telegram set_user_parameter(bool permanent, std::uint16_t id, std::uint16_t value) {
  return with_words(Id::SetUserParameter, {permanent, id, value});
}
Telegram get_user_parameter(std::uint16_t id) { return with_words(Id::GetUserParameter, {id}); }
Telegram set_task_parameter(bool permanent, std::uint16_t id, const std::vector<std::uint16_t>& values) {
  Telegram telegram = with_words(Id::SetTaskParameter, {permanent, id});
  telegram.words.insert(telegram.words.end(), values.begin(), values.end());
  return telegram;
}
Telegram get_task_parameter(std::uint16_t id) { return with_words(Id::GetTaskParameter, {id}); }

Expected<Parameter, DecodeError> parameter_of(const Telegram& telegram) {
  const auto& words = telegram.words;
  if (telegram.id != Id::TaskParameter) return unexpected(error(DecodeError::Kind::BadContent, kIdByte));
  if (words.size() < kParameterHeadWords || words.size() != kParameterHeadWords + words[2])
    return unexpected(error(DecodeError::Kind::BadContent, kCountByte));
  return Parameter{words[0],
                   words[1],
                   joined(words[3], words[4]),
                   joined(words[5], words[6]),
                   words[7],
                   {words.begin() + kParameterHeadWords, words.end()}};
}

Telegram telegram_of(const Parameter& p, Status status) {
  std::vector<std::uint16_t> words{p.id,        p.type,     static_cast<std::uint16_t>(p.values.size()),
                                   high(p.min), low(p.min), high(p.max),
                                   low(p.max),  p.fields};
  words.insert(words.end(), p.values.begin(), p.values.end());
  return answer(Id::TaskParameter, Id::GetTaskParameter, status, std::move(words));
}

Telegram answer(Id id, Id asked, Status status, std::vector<std::uint16_t> words) {
  Telegram telegram = with_words(id, std::move(words));
  telegram.transaction = static_cast<std::uint16_t>(asked);
  telegram.status = status;
  return telegram;
}
}  // namespace binpick::drivers::lps36
