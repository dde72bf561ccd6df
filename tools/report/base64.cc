#include "tools/report/base64.h"

#include <algorithm>

namespace haustra::report {

std::string ToBase64(std::span<const std::uint8_t> bytes) {
  constexpr char kAlphabet[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t num = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = std::uint32_t{bytes[i]} << 16;
    if (num > 1) group |= std::uint32_t{bytes[i + 1]} << 8;
    if (num > 2) group |= bytes[i + 2];
    text += kAlphabet[group >> 18];
    text += kAlphabet[group >> 12 & 63];
    text += num > 1 ? kAlphabet[group >> 6 & 63] : '=';
    text += num > 2 ? kAlphabet[group & 63] : '=';
  }
  return text;
}

}  // namespace haustra::report
