#include "plc/modbus_reply.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <modbus/modbus.h>
#include <stdexcept>
#include <string>
#include <sys/socket.h>
#include <unistd.h>

#include "plc/modbus_guard.hpp"

namespace binpick::plc::modbus {
Reply::Reply(std::size_t words) : words_(words) {
  std::array<int, 2> pair{};
  // One send is one answer: message boundaries are kept.
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0, pair.data()) != 0)
    throw std::runtime_error(std::string("no socket pair for the Modbus answers: ") + std::strerror(errno));
  ours_ = pair[0];
  theirs_ = pair[1];
  context_ = modbus_new_tcp("127.0.0.1", 502);  // the address is never used: we give it the socket
  if (context_ == nullptr) {
    close(ours_);
    close(theirs_);
    throw std::runtime_error(std::string("libmodbus gives no context: ") + modbus_strerror(errno));
  }
  modbus_set_socket(context_, theirs_);
  // libmodbus sleeps for the response time-out before some exceptions; the guard lets none of them happen, and were one
  // to happen, it would be a microsecond.
  modbus_set_response_timeout(context_, 0, 1);
}

Reply::~Reply() {
  modbus_free(context_);
  close(ours_);
  close(theirs_);
}

Bytes Reply::answer(ByteView adu) {
  modbus_mapping_t mapping{};
  mapping.nb_registers = static_cast<int>(words_.size());
  mapping.tab_registers = words_.data();
  mapping.nb_input_registers = mapping.nb_registers;
  mapping.tab_input_registers = mapping.tab_registers;
  // libmodbus's own buffers are this long, and some of its copies go by the longest frame.
  std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> request{};
  if (adu.size() > request.size()) return {};
  std::memcpy(request.data(), adu.data(), adu.size());
  if (modbus_reply(context_, request.data(), static_cast<int>(adu.size()), &mapping) < 0) return {};
  Bytes out(kAduBytesMax);
  const auto n = recv(ours_, out.data(), out.size(), MSG_DONTWAIT);
  out.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
  return out;
}
}  // namespace binpick::plc::modbus
