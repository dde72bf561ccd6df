#include "capture/v4l2/v4l2_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/videodev2.h>

namespace haustra {
namespace {

using testing::HasSubstr;

TEST(V4l2Options, ASpecNamesDeviceAndOptions) {
  const Result<V4l2Options> options = ParseV4l2Spec(
      "v4l2:/dev/video2,size=1440x1080,rate=50,max-rate=12.5,format=NV12,input=SDI "
      "1,region=1350x1080+45+0,field=bottom,"
      "buffers=6,memory=dmabuf,wait=yes");
  ASSERT_TRUE(options.ok()) << options.status().ToString();
  EXPECT_EQ(options->device, "/dev/video2");
  EXPECT_EQ(options->width_px, 1440);
  EXPECT_EQ(options->height_px, 1080);
  EXPECT_EQ(options->rate_hz, 50);
  EXPECT_EQ(options->max_rate_hz, 12.5);
  EXPECT_EQ(options->format, V4L2_PIX_FMT_NV12);
  EXPECT_EQ(options->input, "SDI 1");
  EXPECT_EQ(options->region.width_px, 1350);
  EXPECT_EQ(options->region.height_px, 1080);
  EXPECT_EQ(options->region.x_px, 45);
  EXPECT_EQ(options->region.y_px, 0);
  EXPECT_EQ(options->field, FieldChoice::kBottom);
  EXPECT_EQ(options->num_buffers, 6);
  EXPECT_EQ(options->memory, BufferMemory::kDmaBuf);
  EXPECT_TRUE(options->may_come_later);
}

TEST(V4l2Options, TheDeviceAloneIsEnough) {
  const Result<V4l2Options> options = ParseV4l2Spec("v4l2:Tower Camera");
  ASSERT_TRUE(options.ok());
  EXPECT_EQ(options->device, "Tower Camera");
  EXPECT_EQ(options->max_rate_hz, 25);
  EXPECT_TRUE(IsV4l2Spec("v4l2:x"));
  EXPECT_FALSE(IsV4l2Spec("/dev/video0"));
}

// It would be waited for in vain.
TEST(V4l2Options, NoCameraHasFieldsOfMjpegPictures) {
  const Result<V4l2Options> options = ParseV4l2Spec("v4l2:/dev/video0,field=top,format=MJPEG");
  EXPECT_EQ(options.code(), StatusCode::kInvalidArgument);
  EXPECT_THAT(options.status().message(), HasSubstr("fields of MJPEG pictures are not read"));
}

TEST(V4l2Options, WhatIsWrongIsQuoted) {
  for (const char* part : {"size=1440",
                           "size=0x5",
                           "size=1440x1080x3",
                           "size=-1x4",
                           "size=99999x2",
                           "rate=0",
                           "rate=nan",
                           "rate=fast",
                           "rate=1e9",
                           "max-rate=-1",
                           "format=RGB",
                           "format=",
                           "input=",
                           "region=10x10",
                           "region=10x10+5",
                           "region=10x10+5+-1",
                           "region=0x10+0+0",
                           "field=both",
                           "buffers=x",
                           "memory=mine",
                           "wait=1",
                           "colour=red",
                           "size",
                           "",
                           "buffers=1",
                           "buffers=33"}) {
    const Result<V4l2Options> options = ParseV4l2Spec(std::string("v4l2:/dev/video0,") + part);
    EXPECT_EQ(options.code(), StatusCode::kInvalidArgument) << part;
    EXPECT_THAT(options.status().message(), HasSubstr(std::string("'") + part + "'"));
  }
  EXPECT_EQ(ParseV4l2Spec("v4l2:").code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(ParseV4l2Spec("v4l2:,size=4x4").code(), StatusCode::kInvalidArgument);
  EXPECT_EQ(ParseV4l2Spec("/dev/video0").code(), StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace haustra
