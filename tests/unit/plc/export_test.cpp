#include "plc/export.hpp"

#include <algorithm>
#include <gtest/gtest.h>

#include "plc/counterpart.hpp"
#include "plc/export_program.hpp"
#include "plc/result_codes.hpp"

namespace binpick::plc {
namespace {
std::vector<ExportFile> everything(const ExportOptions& options = {}) {
  auto out = export_s7(options);
  for (auto& file : export_logix(options)) out.push_back(std::move(file));
  return out;
}
const std::string& content(const std::vector<ExportFile>& files, std::string_view name) {
  const auto found = std::ranges::find(files, name, &ExportFile::name);
  if (found == files.end()) throw std::runtime_error("no file " + std::string(name));
  return found->content;
}
bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(Export, SameOptionsSameBytes) {
  const auto first = everything(), second = everything();
  ASSERT_EQ(first.size(), second.size());
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(first[i].content, second[i].content) << first[i].name;
}

TEST(Export, BlocksHoldTheWholeMapInItsOrder) {
  std::size_t next = 0;
  for (const Block& block : map_blocks())
    for (const Register& r : registers_of(block)) EXPECT_EQ(r.name, kRegisters.at(next++).name);
  EXPECT_EQ(next, kRegisters.size());
}

TEST(Export, EveryRegisterStandsInEveryMakersTypes) {
  const auto files = everything();
  for (const Block& block : map_blocks())
    for (const Register& r : registers_of(block)) {
      const std::string name{r.name};
      EXPECT_TRUE(has(content(files, "BinPick.scl"), "      " + name + " : ")) << name;
      for (const std::string& file : {std::string("BinPick.L5X"), std::string(block.type) + ".L5X"})
        EXPECT_TRUE(has(content(files, file), "<Member Name=\"" + name + "\" ")) << file << " " << name;
    }
}

TEST(Export, EveryStepAndResultCodeStandsInEveryProgram) {
  const auto files = everything();
  for (const std::string_view file : {"BinPick.scl", "BinPick.st", "BinPick.L5X"}) {
    for (const PlcStepText& s : kPlcSteps)
      EXPECT_TRUE(
          has(content(files, file), std::to_string(static_cast<unsigned>(s.step)) + ":  // " + std::string(s.name)))
          << file << " " << s.name;
    for (const ResultText& r : result_table()) EXPECT_TRUE(has(content(files, file), std::string(r.name))) << file;
  }
}

TEST(Export, PlainTextWithTheMakersLineEnds) {
  for (const auto& [name, text] : everything()) {
    const std::string_view mark = "\xEF\xBB\xBF";
    const std::string_view body = std::string_view{text}.substr(text.starts_with(mark) ? mark.size() : 0);
    EXPECT_TRUE(std::ranges::all_of(body, [](unsigned char c) { return c < 0x80; })) << name;
    EXPECT_TRUE(body.ends_with("\r\n")) << name;
    EXPECT_EQ(std::ranges::count(body, '\n'), std::ranges::count(body, '\r')) << name;
    EXPECT_FALSE(has(text, "@") || has(text, "!timer") || has(text, "{Idle}")) << name << " has unspoken text";
  }
}

TEST(Export, AddressesFollowTheOptions) {
  ExportOptions options;
  options.host = {10, 1, 2, 3};
  options.port = 1502;
  options.base_address = 200;
  options.answer_timeout = std::chrono::milliseconds(41000);
  options.pose_convention = PoseConvention::Fanuc;
  const auto files = everything(options);
  const std::string& scl = content(files, "BinPick.scl");
  EXPECT_TRUE(has(scl, "MB_MODE := 2, MB_DATA_ADDR := 40201, MB_DATA_LEN := 8"));
  EXPECT_TRUE(has(scl, "MB_MODE := 0, MB_DATA_ADDR := 40209, MB_DATA_LEN := 80"));
  EXPECT_TRUE(has(scl, "connect.RemoteAddress.ADDR[2] := 1;"));
  EXPECT_TRUE(has(scl, "connect.RemotePort := 1502;"));
  EXPECT_TRUE(has(scl, "PT := T#41000ms"));
  EXPECT_TRUE(has(scl, "grasp_x : Real;   // 40263 (word 62), mm"));
  EXPECT_TRUE(has(scl, "retreat_z : Real;   // 40279 (word 78), mm"));
  EXPECT_TRUE(has(content(files, "BinPick.st"), "t_answer.PRE := 41000;"));
  EXPECT_TRUE(has(content(files, "BinPick_Tags.CSV"), "function 16, address 200, 8 words"));
  // Five digits end at 49999.
  options.base_address = 9920;
  EXPECT_TRUE(has(export_s7(options)[0].content, "MB_DATA_ADDR := 409921,"));
}

TEST(Export, WhereTheCellIsTheClientThePlcServesTheMap) {
  ExportOptions options;
  options.role = LineRole::Client;
  options.host = {10, 1, 2, 3};
  options.port = 1502;
  options.base_address = 200;
  const auto files = everything(options);
  const std::string& scl = content(files, "BinPick.scl");
  EXPECT_TRUE(has(scl, "server : MB_SERVER;") && has(scl, "#server(DISCONNECT := NOT #enable,"));
  EXPECT_FALSE(has(scl, "MB_CLIENT") || has(scl, "MB_DATA_PTR") || has(scl, "t_poll"));
  EXPECT_TRUE(has(scl, "#server.HR_Start_Offset := 200;"));
  EXPECT_TRUE(has(scl, "MB_HOLD_REG := \"BinPick_Data\".registers"));
  EXPECT_TRUE(has(scl, "connect.ActiveEstablished := FALSE;") && has(scl, "connect.RemotePort := 0;") &&
              has(scl, "connect.LocalPort := 1502;") && has(scl, "connect.RemoteAddress.ADDR[2] := 1;"));
  EXPECT_TRUE(has(content(files, "BinPick_Tags.CSV"), "holding registers from address 200, 8 words"));
  EXPECT_TRUE(has(content(files, "BinPick_Tags.CSV"), "holding registers from address 208, 80 words"));
  EXPECT_TRUE(has(content(files, "BinPick.st"), "another program, the Modbus server, moves both arrays"));
  // The handshake is the same program, word for word.
  ExportOptions served = options;
  served.role = LineRole::Server;
  EXPECT_EQ(program_body(Dialect::S7, options), program_body(Dialect::S7, served));
}

TEST(Export, TheBitsOfAStepAreWrittenFromTheTable) {
  const std::string s7 = program_body(Dialect::S7, {}), logix = program_body(Dialect::Logix, {});
  EXPECT_TRUE(has(s7, "#request.control.%X0 := (#step = 20);"));
  EXPECT_TRUE(has(s7, "#request.control.%X3 := #robot_clear;"));
  EXPECT_TRUE(has(logix, "request.control.1 := (step = 80);"));
  EXPECT_TRUE(has(logix, "TONR(t_answer);"));
  EXPECT_FALSE(has(logix, "TRUE") || has(logix, "FALSE") || has(logix, "#"));
}
}  // namespace
}  // namespace binpick::plc
