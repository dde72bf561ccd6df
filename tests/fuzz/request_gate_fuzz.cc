#include "tools/view/request_gate.h"

#include <sys/stat.h>

#include <string>
#include <string_view>

#include "hal/core/check.h"
#include "tests/fuzz/fuzz_entries.h"
#include "tests/fuzz/memory_file.h"

namespace haustra::test {

// Parts: method, path, Host, Origin, Sec-Fetch-Site, of which the last two may be missing.
void FuzzRequestGate(std::span<const std::uint8_t> bytes) {
  const std::string token = "0123456789abcdef0123456789abcdef";
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  view::RequestHead head;
  head.method = TakePart(&text);
  head.path = TakePart(&text);
  head.host = TakePart(&text);
  if (!text.empty()) head.origin = TakePart(&text);
  if (!text.empty()) head.fetch_site = TakePart(&text);
  if (const auto name = view::RequestGate(token, 8000).Admit(head)) {
    HAUSTRA_CHECK(head.method == "GET");
    HAUSTRA_CHECK(head.path == "/" + token + "/" + std::string(*name));
    HAUSTRA_CHECK(head.host == "127.0.0.1:8000" || head.host == "localhost:8000");
    HAUSTRA_CHECK(!head.origin || *head.origin == "http://" + std::string(head.host));
    HAUSTRA_CHECK(!head.fetch_site || *head.fetch_site == "same-origin" || *head.fetch_site == "none");
  }

  const MemoryFile file(bytes);
  HAUSTRA_CHECK(chmod(file.path().c_str(), S_IRUSR | S_IWUSR) == 0);
  const Result<std::string> read = view::ReadToken(file.path());
  if (!read.ok()) {
    HAUSTRA_CHECK(!read.status().message().empty());
    return;
  }
  HAUSTRA_CHECK(read->size() >= 32 && read->size() <= 128);
  const std::string path = "/" + *read + "/";
  HAUSTRA_CHECK(view::RequestGate(*read, 8000).Admit({"GET", path, "127.0.0.1:8000", {}, {}}).has_value());
}

}  // namespace haustra::test
