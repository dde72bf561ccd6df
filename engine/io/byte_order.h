// Numbers as little-endian bytes, whatever the machine. ByteWriter appends to a string; ByteReader takes from a view
// and never reads beyond its end: what is missing reads as zero and is_short() tells. reentrant.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include <Eigen/Core>

#include "engine/geometry/se3.h"

namespace haustra {

class ByteWriter {
 public:
  explicit ByteWriter(std::string* bytes) : bytes_(bytes) {}

  void U32(std::uint32_t value) { Put(value, 4); }
  void U64(std::uint64_t value) { Put(value, 8); }
  void I32(std::int32_t value) { U32(static_cast<std::uint32_t>(value)); }
  void I64(std::int64_t value) { U64(static_cast<std::uint64_t>(value)); }
  void F32(float value) { U32(std::bit_cast<std::uint32_t>(value)); }
  void F64(double value) { U64(std::bit_cast<std::uint64_t>(value)); }
  void Vector(const Eigen::Vector3d& value) {
    for (int i = 0; i < 3; ++i) F64(value[i]);
  }
  // Quaternion x y z w, translation.
  void Pose(const SE3& value) {
    for (int i = 0; i < 4; ++i) F64(value.rotation.coeffs()[i]);
    Vector(value.translation);
  }

 private:
  void Put(std::uint64_t value, int num_bytes) {
    char bytes[8];
    for (int i = 0; i < num_bytes; ++i) bytes[i] = static_cast<char>(value >> (8 * i) & 0xffu);
    bytes_->append(bytes, static_cast<std::size_t>(num_bytes));
  }

  std::string* bytes_;
};

class ByteReader {
 public:
  // `offset`: of the first byte in its file.
  explicit ByteReader(std::span<const std::uint8_t> bytes, std::uint64_t offset = 0) : bytes_(bytes), start_(offset) {}

  std::uint32_t U32() { return static_cast<std::uint32_t>(Take(4)); }
  std::uint64_t U64() { return Take(8); }
  std::int32_t I32() { return static_cast<std::int32_t>(U32()); }
  std::int64_t I64() { return static_cast<std::int64_t>(U64()); }
  float F32() { return std::bit_cast<float>(U32()); }
  double F64() { return std::bit_cast<double>(U64()); }
  Eigen::Vector3d Vector() {
    Eigen::Vector3d value;
    for (int i = 0; i < 3; ++i) value[i] = F64();
    return value;
  }
  // As written: the quaternion is not normalised, so that the bits stay.
  SE3 Pose() {
    SE3 value;
    for (int i = 0; i < 4; ++i) value.rotation.coeffs()[i] = F64();
    value.translation = Vector();
    return value;
  }
  // The next `size` bytes as they are; empty when there are not so many.
  std::span<const std::uint8_t> Bytes(std::size_t size) {
    if (size > num_left()) {
      is_short_ = true;
      next_ = bytes_.size();
      return {};
    }
    next_ += size;
    return bytes_.subspan(next_ - size, size);
  }

  std::size_t num_left() const { return bytes_.size() - next_; }
  std::uint64_t offset() const { return start_ + next_; }
  bool is_short() const { return is_short_; }

 private:
  std::uint64_t Take(std::size_t num_bytes) {
    const std::span<const std::uint8_t> bytes = Bytes(num_bytes);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) value |= std::uint64_t{bytes[i]} << (8 * i);
    return value;
  }

  std::span<const std::uint8_t> bytes_;
  std::uint64_t start_;
  std::size_t next_ = 0;
  bool is_short_ = false;
};

}  // namespace haustra
