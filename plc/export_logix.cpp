#include "plc/export.hpp"
#include "plc/export_program.hpp"

namespace binpick::plc {
namespace {
constexpr std::string_view kProgram = "BinPick";
constexpr std::string_view kWriteArray = "BinPick_Write", kReadArray = "BinPick_Read";

/// Logix has no unsigned words: a number above 32767 reads negative. (Counters and codes stay below in practice.)
std::string_view type_name(Type type) {
  switch (type) {
    case Type::U16:
    case Type::I16:
    case Type::Bits:
      return "INT";
    case Type::U32:
      return "DINT";
    case Type::F32:
      return "REAL";
  }
  return "";
}
std::string_view radix_of(Type type) { return type == Type::F32 ? "Float" : type == Type::Bits ? "Binary" : "Decimal"; }

std::string_view type_name(Variable::Kind kind) {
  switch (kind) {
    case Variable::Kind::Bool:
      return "BOOL";
    case Variable::Kind::Number:
    case Variable::Kind::Word:
      return "INT";
    case Variable::Kind::Timer:
      return "FBD_TIMER";
    case Variable::Kind::Request:
      return "BinPick_Request";
    case Variable::Kind::Status:
      return "BinPick_Status";
    case Variable::Kind::Result:
      return "BinPick_Result";
  }
  return "";
}

struct Tag {
  std::string scope;  ///< Empty: controller.
  std::string name, type;
  unsigned dimension;  ///< 0: no array.
  std::string radix;   ///< Empty: a structure has none.
  std::string help;
};

std::vector<Tag> tags(const ExportOptions& options) {
  const std::string base = std::to_string(options.base_address);
  const std::string answer = std::to_string(options.base_address + kStatusFirst);
  const std::string request_words = std::to_string(kRequestLength),
                    answer_words = std::to_string(kStatusLength + kResultLength);
  const bool asked = options.role == LineRole::Client;
  std::vector<Tag> out{
      {"", std::string(kWriteArray), "INT", kRequestLength, "Decimal",
       "Request block: " +
           (asked ? "copy to the server's holding registers from address " + base : "function 16, address " + base) +
           ", " + request_words + " words"},
      {"", std::string(kReadArray), "INT", kStatusLength + kResultLength, "Decimal",
       "Status and result: " +
           (asked ? "copy from the server's holding registers from address " + answer
                  : "function 3, address " + answer) +
           ", " + answer_words + " words"}};
  for (const Variable& v : program_variables()) {
    const bool elementary =
        v.kind == Variable::Kind::Bool || v.kind == Variable::Kind::Number || v.kind == Variable::Kind::Word;
    out.push_back({std::string(kProgram), std::string(v.name), std::string(type_name(v.kind)), 0,
                   elementary ? "Decimal" : "", ascii(v.help)});
  }
  return out;
}

std::string cdata(std::string_view text) { return "<![CDATA[" + std::string(text) + "]]>"; }

std::string described(const std::string& help) {
  return help.empty() ? "" : "\n<Description>\n" + cdata(help) + "\n</Description>\n";
}

std::string data_type(const Block& block, bool target, const ExportOptions& options) {
  std::string out = "<DataType " + std::string(target ? "Use=\"Target\" " : "") + "Name=\"" + std::string(block.type) +
                    "\" Family=\"NoFamily\" Class=\"User\">\n<Description>\n" + cdata(ascii(help_of(block, options))) +
                    "\n</Description>\n<Members>\n";
  for (const Register& r : registers_of(block))
    out += "<Member Name=\"" + std::string(r.name) + "\" DataType=\"" + std::string(type_name(r.type)) +
           "\" Dimension=\"0\" Radix=\"" + std::string(radix_of(r.type)) +
           "\" Hidden=\"false\" ExternalAccess=\"Read/Write\">" + described(comment_of(r, options)) + "</Member>\n";
  return out + "</Members>\n</DataType>\n";
}

std::string tag_element(const Tag& tag) {
  return "<Tag Name=\"" + tag.name + "\" TagType=\"Base\" DataType=\"" + tag.type + "\"" +
         (tag.dimension > 0 ? " Dimensions=\"" + std::to_string(tag.dimension) + "\"" : "") +
         (tag.radix.empty() ? "" : " Radix=\"" + tag.radix + "\"") +
         " Constant=\"false\" ExternalAccess=\"Read/Write\">" + described(tag.help) + "</Tag>\n";
}

/// The frame of every L5X. Left out because publicly known files do without them, and because the same options give
/// the same bytes: ExportDate, Owner. Not tried with Studio 5000: whether it takes the file so.
std::string l5x(std::string_view target, std::string_view type, const std::string& content) {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\" standalone=\"yes\"?>\n"
         "<!-- Written by 'binpick export plc'. Its form follows publicly known exports; no import was tried. -->\n"
         "<RSLogix5000Content SchemaRevision=\"1.0\" SoftwareRevision=\"32.00\" TargetName=\"" +
         std::string(target) + "\" TargetType=\"" + std::string(type) + "\"" +
         (type == "Program" ? " TargetClass=\"Standard\"" : "") +
         " ContainsContext=\"true\" ExportOptions=\"References NoRawData L5KData DecoratedData Context Dependencies "
         "ForceProtectedEncoding AllProjDocTrans\">\n<Controller Use=\"Context\" Name=\"Any\">\n" +
         content + "</Controller>\n</RSLogix5000Content>\n";
}

std::string structured_text(const ExportOptions& options) {
  std::string out;
  for (const std::string& line : program_head(options)) out += "// " + line + "\n";
  const std::string read{kReadArray}, write{kWriteArray};
  // CPS, as COP, copies bytes; unlike COP it is not interrupted by the task that receives.
  out +=
      "// 32-bit values: low word first; the cell file has plc.word_order = \"logix\".\n"
      "// A number of the map above 32767 reads negative here: add 65536.\n\n"
      "// 0. The blocks: another program, the Modbus " +
      std::string(options.role == LineRole::Client ? "server" : "client") +
      ", moves both arrays (see BinPick_Write, BinPick_Read).\n"
      "CPS(" +
      read + "[0], status, 1);\nCPS(" + read + "[" + std::to_string(kStatusLength) + "], answer, 1);\n\n" +
      program_body(Dialect::Logix, options) + "\n// 6. What the Modbus client writes next.\nCPS(request, " + write +
      "[0], " + std::to_string(kRequestLength) + ");\n";
  return out;
}

std::string program(const ExportOptions& options) {
  std::string out = "<DataTypes Use=\"Context\">\n";
  for (const Block& block : map_blocks()) out += data_type(block, false, options);
  out += "</DataTypes>\n<Tags Use=\"Context\">\n";
  std::string own;
  for (const Tag& tag : tags(options)) (tag.scope.empty() ? out : own) += tag_element(tag);
  out += "</Tags>\n<Programs Use=\"Context\">\n<Program Use=\"Target\" Name=\"" + std::string(kProgram) +
         "\" TestEdits=\"false\" MainRoutineName=\"Main\" Disabled=\"false\" UseAsFolder=\"false\">\n<Tags>\n" + own +
         "</Tags>\n<Routines>\n<Routine Name=\"Main\" Type=\"ST\">\n<STContent>\n";
  const std::string text = structured_text(options);
  unsigned line = 0;
  for (std::size_t at = 0; at < text.size(); ++line) {
    const std::size_t end = text.find('\n', at);
    out += "<Line Number=\"" + std::to_string(line) + "\">\n" + cdata(text.substr(at, end - at)) + "\n</Line>\n";
    at = end + 1;
  }
  return out + "</STContent>\n</Routine>\n</Routines>\n</Program>\n</Programs>\n";
}

/// A text of the tag CSV: the dollar is its escape sign.
std::string csv_text(std::string_view text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '$')
      out += "$$";
    else if (c == '"')
      out += "$Q";
    else if (c == '\'')
      out += "$'";
    else
      out += c;
  }
  return out + "\"";
}

std::string tag_csv(const ExportOptions& options) {
  std::string out =
      "remark,\"CSV-Import-Export\"\nremark,\"Version = RSLogix 5000 v32.00\"\nremark,\"Owner = \"\n"
      "remark,\"Company = \"\n0.3\nTYPE,SCOPE,NAME,DESCRIPTION,DATATYPE,SPECIFIER,ATTRIBUTES\n";
  for (const Tag& tag : tags(options))
    out += "TAG," + tag.scope + "," + tag.name + "," + csv_text(tag.help) + ",\"" + tag.type +
           (tag.dimension > 0 ? "[" + std::to_string(tag.dimension) + "]" : "") + "\",\"\",\"(" +
           (tag.radix.empty() ? "" : "RADIX := " + tag.radix + ", ") +
           "Constant := false, ExternalAccess := Read/Write)\"\n";
  return out;
}
}  // namespace

std::vector<ExportFile> export_logix(const ExportOptions& options) {
  std::vector<ExportFile> out{{"BinPick.L5X", crlf(l5x(kProgram, "Program", program(options)))},
                              {"BinPick.st", crlf(structured_text(options))},
                              {"BinPick_Tags.CSV", crlf(tag_csv(options))}};
  for (const Block& block : map_blocks())
    out.push_back({std::string(block.type) + ".L5X",
                   crlf(l5x(block.type, "DataType",
                            "<DataTypes Use=\"Context\">\n" + data_type(block, true, options) + "</DataTypes>\n"))});
  return out;
}
}  // namespace binpick::plc
