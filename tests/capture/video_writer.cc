#include "tests/capture/video_writer.h"

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
}

#include <cstring>
#include <memory>

namespace haustra {
namespace {

struct FormatCloser {
  void operator()(AVFormatContext* format) const {
    if (format->pb != nullptr) avio_closep(&format->pb);
    avformat_free_context(format);
  }
};
struct CodecCloser {
  void operator()(AVCodecContext* codec) const { avcodec_free_context(&codec); }
};
struct FrameCloser {
  void operator()(AVFrame* frame) const { av_frame_free(&frame); }
};
struct PacketCloser {
  void operator()(AVPacket* packet) const { av_packet_free(&packet); }
};

class Writer {
 public:
  std::string Run(const std::string& path, const std::string& codec_name, int rate_hz, const std::vector<Image>& frames,
                  const StampGap& gap) {
    const AVCodec* encoder = avcodec_find_encoder_by_name(codec_name.c_str());
    if (encoder == nullptr) return "no encoder " + codec_name;
    AVFormatContext* format = nullptr;
    if (avformat_alloc_output_context2(&format, nullptr, nullptr, path.c_str()) < 0) return "no container for " + path;
    format_.reset(format);
    codec_.reset(avcodec_alloc_context3(encoder));
    codec_->width = frames[0].width();
    codec_->height = frames[0].height();
    codec_->time_base = {1, rate_hz};
    codec_->framerate = {rate_hz, 1};
    codec_->pix_fmt = codec_name == "ffv1"    ? AV_PIX_FMT_GRAY8
                      : codec_name == "mjpeg" ? AV_PIX_FMT_YUVJ420P
                                              : AV_PIX_FMT_YUV420P;
    codec_->bit_rate = 4'000'000;
    codec_->gop_size = 5;
    codec_->strict_std_compliance = FF_COMPLIANCE_UNOFFICIAL;
    if ((format->oformat->flags & AVFMT_GLOBALHEADER) != 0) codec_->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
    if (avcodec_open2(codec_.get(), encoder, nullptr) < 0) return "encoder does not open";
    stream_ = avformat_new_stream(format, nullptr);
    stream_->time_base = codec_->time_base;
    stream_->avg_frame_rate = codec_->framerate;
    avcodec_parameters_from_context(stream_->codecpar, codec_.get());
    if (avio_open(&format->pb, path.c_str(), AVIO_FLAG_WRITE) < 0) return "cannot create " + path;
    if (avformat_write_header(format, nullptr) < 0) return "header not written";
    packet_.reset(av_packet_alloc());
    for (std::size_t i = 0; i < frames.size(); ++i) {
      const bool is_after = gap.gap_s > 0 && static_cast<int>(i) >= gap.frame;
      if (!Encode(frames[i], static_cast<std::int64_t>(i) + (is_after ? gap.gap_s * rate_hz - 1 : 0)))
        return "frame not encoded";
    }
    if (avcodec_send_frame(codec_.get(), nullptr) < 0 || !WritePackets()) return "not flushed";
    return av_write_trailer(format) < 0 ? "trailer not written" : "";
  }

 private:
  bool Encode(const Image& image, std::int64_t pts) {
    const std::unique_ptr<AVFrame, FrameCloser> frame(av_frame_alloc());
    frame->width = codec_->width;
    frame->height = codec_->height;
    frame->format = codec_->pix_fmt;
    frame->pts = pts;
    if (av_frame_get_buffer(frame.get(), 0) < 0) return false;
    for (int y = 0; y < image.height(); ++y) {
      std::memcpy(frame->data[0] + y * frame->linesize[0], image.row(y), static_cast<std::size_t>(image.width()));
    }
    for (int plane = 1; plane < 3 && frame->data[plane] != nullptr; ++plane) {
      std::memset(frame->data[plane], 128,
                  static_cast<std::size_t>(frame->linesize[plane]) * ((image.height() + 1) / 2));
    }
    return avcodec_send_frame(codec_.get(), frame.get()) >= 0 && WritePackets();
  }

  bool WritePackets() {
    while (avcodec_receive_packet(codec_.get(), packet_.get()) == 0) {
      av_packet_rescale_ts(packet_.get(), codec_->time_base, stream_->time_base);
      packet_->stream_index = stream_->index;
      if (av_interleaved_write_frame(format_.get(), packet_.get()) < 0) return false;
    }
    return true;
  }

  std::unique_ptr<AVFormatContext, FormatCloser> format_;
  std::unique_ptr<AVCodecContext, CodecCloser> codec_;
  std::unique_ptr<AVPacket, PacketCloser> packet_;
  AVStream* stream_ = nullptr;
};

}  // namespace

std::string WriteVideo(const std::string& path, const std::string& codec, int rate_hz,
                       const std::vector<Image>& grey_frames, const StampGap& gap) {
  return Writer().Run(path, codec, rate_hz, grey_frames, gap);
}

}  // namespace haustra
