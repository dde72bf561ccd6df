#include "capture/codec/image_codec.h"

#include <span>

#include "capture/codec/jpeg_codec.h"
#include "capture/codec/png_codec.h"
#include "capture/files/file_sink.h"
#include "capture/files/whole_file.h"
#include "capture/image_transform.h"

namespace haustra {
namespace {

using capture::internal::DecodeJpeg;
using capture::internal::DecodeJpegSize;
using capture::internal::DecodePng;
using capture::internal::DecodePngSize;
using capture::internal::IsJpeg;
using capture::internal::IsPng;

constexpr std::size_t kMaxImageFileBytes = std::size_t{512} << 20;

Status WithPath(const std::string& path, const Status& status) {
  if (status.ok()) return status;
  return Status(status.code(), path + ": " + status.message());
}

Status UnknownKind(const std::string& path, std::span<const std::uint8_t> bytes) {
  return DataLoss(path + (bytes.empty() ? ": empty file" : ": neither a PNG nor a JPEG file"));
}

Status CheckWritable(const std::string& path, const ImageView& image) {
  if (!image.is_empty()) return Status::Ok();
  return InvalidArgument(path + ": an image without pixels cannot be written");
}

}  // namespace

Status ImageReader::Read(const std::string& path, ChannelChoice channels, Image* image) {
  HAUSTRA_TRY(ReadWholeFile(path, kMaxImageFileBytes, &file_));
  if (IsJpeg(file_)) return WithPath(path, DecodeJpeg(file_, channels, image));
  if (!IsPng(file_)) return UnknownKind(path, file_);
  if (channels == ChannelChoice::kAsStored) return WithPath(path, DecodePng(file_, image));
  HAUSTRA_TRY(WithPath(path, DecodePng(file_, &colour_)));
  ToGrey(colour_.view(), image);
  return Status::Ok();
}

Result<ImageSize> ImageReader::ReadSize(const std::string& path) {
  HAUSTRA_TRY(ReadWholeFile(path, kMaxImageFileBytes, &file_));
  if (!IsJpeg(file_) && !IsPng(file_)) return UnknownKind(path, file_);
  Result<ImageSize> size = IsJpeg(file_) ? DecodeJpegSize(file_) : DecodePngSize(file_);
  if (!size.ok()) return WithPath(path, size.status());
  return size;
}

Result<Image> ReadImage(const std::string& path, ChannelChoice channels) {
  ImageReader reader;
  Image image;
  HAUSTRA_TRY(reader.Read(path, channels, &image));
  return image;
}

Status WriteJpeg(const std::string& path, ImageView image, int quality) {
  HAUSTRA_TRY(CheckWritable(path, image));
  if (quality < 1 || quality > 100) {
    return InvalidArgument(path + ": JPEG quality " + std::to_string(quality) + " is not in 1 to 100");
  }
  std::vector<std::uint8_t> bytes;
  HAUSTRA_TRY(WithPath(path, capture::internal::EncodeJpeg(image, quality, &bytes)));
  return WriteEncoded(path, bytes);
}

Status WritePng(const std::string& path, ImageView image) {
  HAUSTRA_TRY(CheckWritable(path, image));
  std::vector<std::uint8_t> bytes;
  HAUSTRA_TRY(WithPath(path, capture::internal::EncodePng(image, &bytes)));
  return WriteEncoded(path, bytes);
}

Status WriteEncoded(const std::string& path, std::span<const std::uint8_t> bytes) {
  return WriteWholeFile(path, bytes, Outlasts::kProcess);
}

}  // namespace haustra
