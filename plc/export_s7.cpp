#include <utility>

#include "plc/export.hpp"
#include "plc/export_program.hpp"

namespace binpick::plc {
namespace {
std::string_view type_name(Type type) {
  switch (type) {
    case Type::U16:
      return "UInt";
    case Type::I16:
      return "Int";
    case Type::U32:
      return "UDInt";
    case Type::F32:
      return "Real";
    case Type::Bits:
      return "Word";
  }
  return "";
}

std::string_view type_name(Variable::Kind kind) {
  switch (kind) {
    case Variable::Kind::Bool:
      return "Bool";
    case Variable::Kind::Number:
      return "UInt";
    case Variable::Kind::Word:
      return "Word";
    case Variable::Kind::Timer:
      return "TON_TIME";
    case Variable::Kind::Request:
      return "\"BinPick_Request\"";
    case Variable::Kind::Status:
      return "\"BinPick_Status\"";
    case Variable::Kind::Result:
      return "\"BinPick_Result\"";
  }
  return "";
}

std::string member(std::string_view indent, std::string_view name, std::string_view attributes, std::string_view type,
                   const std::string& help) {
  std::string out{indent};
  out += name;
  if (!attributes.empty()) out += " " + std::string(attributes);
  out += " : " + std::string(type) + ";";
  if (!help.empty()) out += "   // " + ascii(help);
  return out + "\n";
}

bool cell_asks(const ExportOptions& options) { return options.role == LineRole::Client; }

std::string types(const ExportOptions& options) {
  std::string out;
  for (const Block& block : map_blocks()) {
    out += "TYPE \"" + std::string(block.type) + "\"\nVERSION : 0.1\n   // " + std::string(help_of(block, options)) +
           "\n   STRUCT\n";
    for (const Register& r : registers_of(block))
      out += member("      ", r.name, "", type_name(r.type), comment_of(r, options));
    out += "   END_STRUCT;\n\nEND_TYPE\n\n";
  }
  out += "TYPE \"BinPick_Answer\"\nVERSION : 0.1\n   // " +
         std::string(cell_asks(options) ? "What the cell writes" : "What one function 3 reads") +
         "\n   STRUCT\n"
         "      status : \"BinPick_Status\";\n      result : \"BinPick_Result\";\n   END_STRUCT;\n\nEND_TYPE\n\n";
  if (!cell_asks(options)) return out;
  return out +
         "TYPE \"BinPick_Registers\"\nVERSION : 0.1\n   // The holding registers\n   STRUCT\n"
         "      request : \"BinPick_Request\";\n      answer : \"BinPick_Answer\";\n   END_STRUCT;\n\nEND_TYPE\n\n";
}

/// Standard access: only so does a structure lie in the order of the map, and may be an area of MB_CLIENT or MB_SERVER.
std::string data_block(const ExportOptions& options) {
  if (cell_asks(options))
    return "DATA_BLOCK \"BinPick_Data\"\n{ S7_Optimized_Access := 'FALSE' }\nVERSION : 0.1\nNON_RETAIN\n   STRUCT\n"
           "      registers : \"BinPick_Registers\";   // MB_HOLD_REG\n"
           "   END_STRUCT;\n\nBEGIN\n\nEND_DATA_BLOCK\n\n";
  return "DATA_BLOCK \"BinPick_Data\"\n{ S7_Optimized_Access := 'FALSE' }\nVERSION : 0.1\nNON_RETAIN\n   STRUCT\n"
         "      request : \"BinPick_Request\";   // MB_DATA_PTR of the write job\n"
         "      answer : \"BinPick_Answer\";   // MB_DATA_PTR of the read job\n"
         "   END_STRUCT;\n\nBEGIN\n\nEND_DATA_BLOCK\n\n";
}

std::string connection_block(const ExportOptions& options) {
  const bool asked = cell_asks(options);
  const std::string port = std::to_string(options.port);
  std::string out =
      asked ? "// Who may connect: the cell controller, to LocalPort. " : "// Where the cell controller is. ";
  out +=
      "InterfaceId: hardware identifier of the PROFINET interface (64 on most CPUs).\n"
      "// ID: free in this CPU. ConnectionType 11: TCP.\n"
      "DATA_BLOCK \"BinPick_Connection\"\n{ S7_Optimized_Access := 'TRUE' }\nVERSION : 0.1\nNON_RETAIN\n   STRUCT\n"
      "      connect : TCON_IP_v4;\n   END_STRUCT;\n\nBEGIN\n"
      "   connect.InterfaceId := 64;\n   connect.ID := 1;\n   connect.ConnectionType := 16#0B;\n"
      "   connect.ActiveEstablished := " +
      std::string(asked ? "FALSE" : "TRUE") + ";\n";
  for (std::size_t i = 0; i < options.host.size(); ++i)
    out += "   connect.RemoteAddress.ADDR[" + std::to_string(i + 1) + "] := " + std::to_string(options.host[i]) + ";\n";
  return out + "   connect.RemotePort := " + (asked ? "0" : port) +
         ";\n   connect.LocalPort := " + (asked ? port : "0") + ";\n\nEND_DATA_BLOCK\n\n";
}

std::string declarations(const ExportOptions& options) {
  std::string out;
  for (const auto& [role, section] :
       {std::pair{Role::Input, "VAR_INPUT"}, std::pair{Role::Output, "VAR_OUTPUT"}, std::pair{Role::Inner, "VAR"}}) {
    out += "   " + std::string(section) + "\n";
    for (const Variable& v : program_variables()) {
      if (v.role != role) continue;
      const bool timer = v.kind == Variable::Kind::Timer;
      out += member("      ", v.name, timer ? "{InstructionName := 'TON_TIME'; LibVersion := '1.0'}" : "",
                    type_name(v.kind), std::string(v.help));
    }
    if (role == Role::Output)
      out += member("      ", "mb_status", "", "Word",
                    cell_asks(options) ? "STATUS of MB_SERVER's last error." : "STATUS of MB_CLIENT's last error.");
    if (role == Role::Inner && cell_asks(options)) {
      out += member("      ", "server", "", "MB_SERVER", "One connection, the cell's.");
      out += member("      ", "mb_ndr", "", "Bool", "The cell wrote in this call.");
      out += member("      ", "mb_dr", "", "Bool", "The cell read in this call.");
      out += member("      ", "mb_error", "", "Bool", "");
      out += member("      ", "mb_code", "", "Word", "");
    } else if (role == Role::Inner) {
      out += member("      ", "client", "", "MB_CLIENT", "One instance for both jobs: one connection.");
      out += member("      ", "t_poll", "{InstructionName := 'TON_TIME'; LibVersion := '1.0'}", "TON_TIME",
                    "Pause between two polls.");
      out += member("      ", "job", "", "Int", "0 pause, 1 write, 2 read.");
      out += member("      ", "mb_done", "", "Bool", "");
      out += member("      ", "mb_busy", "", "Bool", "");
      out += member("      ", "mb_error", "", "Bool", "");
      out += member("      ", "mb_code", "", "Word", "");
    }
    out += "   END_VAR\n\n";
  }
  return out;
}

/// MB_SERVER answers one request per call, between the program's writing and reading: what the cell reads is whole.
std::string service(const ExportOptions& options) {
  return "   // 0. Modbus/TCP: the cell reads and writes the registers; MB_SERVER serves it, called in every cycle.\n"
         "   \"BinPick_Data\".registers.request := #request;\n"
         "   #server.HR_Start_Offset := " +
         std::to_string(options.base_address) +
         ";\n"
         "   #server(DISCONNECT := NOT #enable,\n"
         "           NDR => #mb_ndr, DR => #mb_dr, ERROR => #mb_error, STATUS => #mb_code,\n"
         "           MB_HOLD_REG := \"BinPick_Data\".registers, CONNECT := \"BinPick_Connection\".connect);\n"
         "   IF #mb_error THEN\n      #mb_status := #mb_code;\n   END_IF;\n"
         "   #status := \"BinPick_Data\".registers.answer.status;\n"
         "   #answer := \"BinPick_Data\".registers.answer.result;\n\n";
}

/// The two jobs in turn. MB_CLIENT wants its inputs, and the area behind MB_DATA_PTR, unchanged while it is at work.
std::string transfer(const ExportOptions& options) {
  const unsigned last = options.base_address + kMapLength - 1U;
  const unsigned one = last < 9999 ? 40001 : 400001;  // five digits reach 49999
  const auto call = [](const std::string& req, const std::string& disconnect, unsigned mode, unsigned address,
                       unsigned length, std::string_view area) {
    return "   #client(REQ := " + req + ", DISCONNECT := " + disconnect + ", MB_MODE := " + std::to_string(mode) +
           ", MB_DATA_ADDR := " + std::to_string(address) + ", MB_DATA_LEN := " + std::to_string(length) +
           ",\n           DONE => #mb_done, BUSY => #mb_busy, ERROR => #mb_error, STATUS => #mb_code,\n"
           "           MB_DATA_PTR := \"BinPick_Data\"." +
           std::string(area) + ", CONNECT := \"BinPick_Connection\".connect);\n";
  };
  return "   // 0. Modbus/TCP: write the request block, read status and result, in turn on one connection.\n"
         "   #t_poll(IN := (#job = 0), PT := T#" +
         std::to_string(options.poll.count()) +
         "ms);\n"
         "   IF (#job = 0) AND #enable AND #t_poll.Q THEN\n"
         "      \"BinPick_Data\".request := #request;\n      #job := 1;\n   END_IF;\n"
         "   IF #job = 1 THEN\n   " +
         call("TRUE", "FALSE", 2, one + options.base_address + kRequestFirst, kRequestLength, "request") +
         "      IF #mb_done THEN\n         #job := 2;\n      ELSIF #mb_error THEN\n         #mb_status := #mb_code;\n"
         "         #job := 0;\n      END_IF;\n   ELSE\n   " +
         call("(#job = 2)", "NOT #enable", 0, one + options.base_address + kStatusFirst, kStatusLength + kResultLength,
              "answer") +
         "      IF (#job = 2) AND #mb_done THEN\n         #status := \"BinPick_Data\".answer.status;\n"
         "         #answer := \"BinPick_Data\".answer.result;\n         #job := 0;\n"
         "      ELSIF (#job = 2) AND #mb_error THEN\n         #mb_status := #mb_code;\n         #job := 0;\n"
         "      END_IF;\n   END_IF;\n\n";
}

std::string function_block(const ExportOptions& options) {
  std::string out = "FUNCTION_BLOCK \"BinPick_Handshake\"\n{ S7_Optimized_Access := 'TRUE' }\nVERSION : 0.1\n";
  for (const std::string& line : program_head(options)) out += "// " + line + "\n";
  out += "// 32-bit values: high word first; the cell file has plc.word_order = \"s7\".\n\n" + declarations(options) +
         "BEGIN\n" + (cell_asks(options) ? service(options) : transfer(options));
  const std::string body = program_body(Dialect::S7, options);
  for (std::size_t at = 0; at < body.size();) {
    const std::size_t end = body.find('\n', at);
    if (end > at) out += "   " + body.substr(at, end - at);
    out += "\n";
    at = end + 1;
  }
  return out + "END_FUNCTION_BLOCK\n";
}
}  // namespace

std::vector<ExportFile> export_s7(const ExportOptions& options) {
  // TIA Portal reads external sources as UTF-8 when they begin with the mark.
  return {{"BinPick.scl", "\xEF\xBB\xBF" + crlf(types(options) + data_block(options) + connection_block(options) +
                                                function_block(options))}};
}
}  // namespace binpick::plc
