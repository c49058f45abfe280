// Options as text. Truth: the values that the units define, and that whatever is not understood is refused by name.
#include "solver/options/option_text.hpp"

#include <gtest/gtest.h>

#include <string>

namespace espalier::solver {
namespace option_text_test {

TEST(OptionText, BytesWithUnits) {
  EXPECT_EQ(parse_bytes("0"), 0);
  EXPECT_EQ(parse_bytes("4096"), 4096);
  EXPECT_EQ(parse_bytes("4096B"), 4096);
  EXPECT_EQ(parse_bytes("3k"), 3 * 1024);
  EXPECT_EQ(parse_bytes("3KB"), 3 * 1024);
  EXPECT_EQ(parse_bytes("512M"), Offset{512} << 20);
  EXPECT_EQ(parse_bytes("2GiB"), Offset{2} << 30);
  EXPECT_EQ(parse_bytes("2 gib"), Offset{2} << 30);
  EXPECT_EQ(parse_bytes("1.5G"), Offset{3} << 29);
  EXPECT_EQ(parse_bytes("4T"), Offset{4} << 40);
}

TEST(OptionText, BytesThatAreNone) {
  for (const char* text : {"", " ", "G", "-1", "-0.5G", "2GG", "2GiBs", "2 G B", "1e3", "0x10", "nan", "inf",
                           "99999999999T", "2,5G", "+2G"}) {
    EXPECT_THROW(static_cast<void>(parse_bytes(text)), Error) << "'" << text << "'";
  }
}

TEST(OptionText, EveryKeyIsKnownAndRefusesNonsense) {
  ASSERT_GE(option_keys().size(), 14u);
  for (const auto key : option_keys()) {
    if (key == "scratch") {
      continue;  // a folder's name: any text may be one, and factorize says where there is none
    }
    Options options;
    try {
      set_option(options, key, "nonsense");
      FAIL() << key << " took nonsense";
    } catch (const Error& e) {
      EXPECT_EQ(e.status().code, StatusCode::invalid_input);
      EXPECT_NE(std::string(e.what()).find(key), std::string::npos) << e.what();
    }
  }
}

TEST(OptionText, ValuesArrive) {
  Options options;
  set_option(options, "kind", "ldlt");
  set_option(options, "precision", "mixed");
  set_option(options, "device-memory", "64M");
  set_option(options, "host_memory", "1G");
  EXPECT_EQ(options.pinned_memory_bytes, -1);
  set_option(options, "pinned-memory", "512M");
  set_option(options, "scratch", "a folder");
  EXPECT_EQ(options.scratch, "a folder");
  set_option(options, "machine", "gpu.flops=2e13,host.front=1e-6");
  set_option(options, "threads", "3");
  set_option(options, "max-block-size", "96");
  set_option(options, "pivot_threshold", "0.125");
  set_option(options, "matching", "off");
  set_option(options, "refinement_steps", "0");
  EXPECT_EQ(options.kind, Kind::ldlt);
  EXPECT_EQ(options.precision, Precision::mixed);
  EXPECT_EQ(options.device_memory_bytes, Offset{64} << 20);
  EXPECT_EQ(options.host_memory_bytes, Offset{1} << 30);
  EXPECT_EQ(options.pinned_memory_bytes, Offset{512} << 20);
  EXPECT_EQ(options.machine, "gpu.flops=2e13,host.front=1e-6");
  EXPECT_THROW(set_option(options, "machine", "gpu.flops=fast"), Error);
  EXPECT_EQ(options.threads, 3);
  EXPECT_EQ(options.max_block_size, 96);
  EXPECT_EQ(options.pivot_threshold, 0.125);
  EXPECT_FALSE(options.matching);
  EXPECT_EQ(options.refinement_steps, 0);
}

TEST(OptionText, BudgetsOfDevices) {
  Options options;
  set_option(options, "device_memory", "8GiB,512M,0");
  EXPECT_EQ(options.device_memory_bytes, 0);
  EXPECT_EQ(options.device_memory_each_bytes, (std::vector<Offset>{Offset{8} << 30, Offset{512} << 20, 0}));
  set_option(options, "device_memory", "1G");
  EXPECT_EQ(options.device_memory_bytes, Offset{1} << 30);
  EXPECT_TRUE(options.device_memory_each_bytes.empty());
  for (const char* bad : {"1G,", ",1G", "1G,,2G", "1G;2G"})
    EXPECT_THROW(set_option(options, "device_memory", bad), Error) << bad;
}

TEST(OptionText, Devices) {
  for (const char* good : {"auto", "cpu", "host:1", "host:2,3", "gpu:all", "gpu:0", "gpu:0,3"}) {
    Options options;
    set_option(options, "device", good);
    EXPECT_EQ(options.device, good);
  }
  for (const char* bad : {"", "CPU!", "host", "host:", "host:0", "host:-1", "host:1,", "host:,1", "gpu", "gpu:a",
                          "gpu:0;1", "gpu:-1", "gpu:0,0", "gpu:0,", "host:1,1,1", "host:99999", "host:2,5000"}) {
    Options options;
    EXPECT_THROW(set_option(options, "device", bad), Error) << "'" << bad << "'";
  }
}

// As others write them: the message has what was meant.
TEST(OptionText, DevicesOfOthersAreNamed) {
  const std::pair<const char*, const char*> meant[] = {
      {"gpu", "'gpu:0'"}, {"GPU", "'gpu:0'"}, {"cuda", "'gpu:0'"}, {"CUDA:1", "'gpu:1'"}, {"Cpu", "'cpu'"}};
  for (const auto& [given, shown] : meant) {
    Options options;
    try {
      set_option(options, "device", given);
      FAIL() << given;
    } catch (const Error& e) {
      EXPECT_NE(e.status().message.find(shown), std::string::npos) << e.status().message;
    }
  }
}

TEST(OptionText, Names) {
  EXPECT_EQ(name_of(Kind::automatic), "auto");
  EXPECT_EQ(name_of(Kind::lu), "lu");
  EXPECT_EQ(name_of(Precision::mixed), "mixed");
  EXPECT_EQ(name_of(StatusCode::accuracy_not_reached), "accuracy_not_reached");
}

}  // namespace option_text_test
}  // namespace espalier::solver
