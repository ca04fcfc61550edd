// SPDX-License-Identifier: BSD-3-Clause
#include <string>

#include "cairn/atlas/store/open_store.hpp"

#include "fuzz/file_in_memory.hpp"
#include "fuzz/imported.hpp"

// An atlas in a file in memory.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::filesystem::path path = cairn::testing::path_in_memory("atlas");
  const std::string name = path.string();
  const auto read = [&](const auto& use) {
    cairn::testing::expect_read_or_refused(
        [&] {
          const auto store = cairn::open_store(path, {.read_only = true});
          use(*store);
        },
        name);
  };
  cairn::testing::write_bytes(path, cairn::testing::text_of(data, size));
  read([](cairn::AtlasStore& store) {
    store.log();
    for (const auto& [id, node] : store.state().nodes) store.map_bytes(node.map);
  });
  read([](cairn::AtlasStore& store) { store.verify(); });
  for (const char* const ending : {"", "-wal", "-shm", "-journal"}) {
    std::filesystem::remove(name + ending);
  }
  return 0;
}
