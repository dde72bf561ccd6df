#include "tools/view/request_gate.h"

#include <sys/random.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstdint>

#include "capture/files/whole_file.h"

namespace haustra::view {
namespace {

constexpr std::size_t kTokenBytes = 16;
constexpr std::size_t kMinTokenLength = 2 * kTokenBytes, kMaxTokenLength = 128;

// Takes the same time wherever they differ.
bool AreEqual(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  unsigned difference = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    difference |= static_cast<unsigned char>(a[i]) ^ static_cast<unsigned char>(b[i]);
  }
  return difference == 0;
}

bool IsTokenLetter(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_'; }

}  // namespace

Result<std::string> MakeToken() {
  std::array<std::uint8_t, kTokenBytes> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    return Unavailable("the system gives no random numbers");
  }
  std::string token;
  for (const std::uint8_t byte : bytes) {
    token += "0123456789abcdef"[byte >> 4];
    token += "0123456789abcdef"[byte & 15];
  }
  return token;
}

Result<std::string> ReadToken(const std::string& path) {
  HAUSTRA_ASSIGN(const std::string text, ReadWholeText(path));
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return Unavailable(path + ": cannot be looked at");
  if ((info.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    return FailedPrecondition(path + ": others than its owner may read it; chmod 600 makes it private");
  }
  const auto is_blank = [](char c) { return std::isspace(static_cast<unsigned char>(c)) != 0; };
  const auto begin = std::find_if_not(text.begin(), text.end(), is_blank);
  const auto end = std::find_if(begin, text.end(), is_blank);
  const std::string token(begin, end);
  if (token.size() < kMinTokenLength || token.size() > kMaxTokenLength || !std::all_of(end, text.end(), is_blank) ||
      !std::all_of(token.begin(), token.end(), IsTokenLetter)) {
    return InvalidArgument(path + ": a token is 32 to 128 letters, digits, '-' or '_', and nothing else");
  }
  return token;
}

std::optional<std::string_view> RequestGate::Admit(const RequestHead& request) const {
  const std::string numeric = "127.0.0.1:" + std::to_string(port_), named = "localhost:" + std::to_string(port_);
  const bool may_change = request.method == "POST";
  if ((!may_change && request.method != "GET") || (may_change && !request.origin)) return std::nullopt;
  if (request.host != numeric && request.host != named) return std::nullopt;
  if (request.origin && *request.origin != "http://" + std::string(request.host)) return std::nullopt;
  // "none": typed, or a bookmark.
  if (request.fetch_site && *request.fetch_site != "same-origin" && *request.fetch_site != "none") return std::nullopt;
  std::string_view path = request.path;
  if (path.size() < token_.size() + 2 || path[0] != '/' || path[token_.size() + 1] != '/') return std::nullopt;
  if (!AreEqual(path.substr(1, token_.size()), token_)) return std::nullopt;
  return path.substr(token_.size() + 2);
}

}  // namespace haustra::view
