#include "tools/view/live_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "platform/publish/pose_ring_writer.h"
#include "platform/publish/view_ring_writer.h"
#include "tests/tools/evaluate/text_folder.h"

namespace haustra::view {
namespace {

// The messages of one kind in a piece of an event stream.
std::vector<nlohmann::json> Messages(const std::string& news, const std::string& kind) {
  std::vector<nlohmann::json> messages;
  const std::string begin = "event: " + kind + "\ndata: ";
  for (std::size_t at = 0; (at = news.find(begin, at)) != std::string::npos;) {
    at += begin.size();
    messages.push_back(nlohmann::json::parse(news.substr(at, news.find("\n\n", at) - at)));
  }
  return messages;
}

haustra_pose PoseAt(std::uint64_t frame) {
  haustra_pose pose{};
  pose.captured_ns = static_cast<std::int64_t>(frame) * 40'000'000;
  pose.published_ns = pose.captured_ns + 12'500'000;
  pose.frame_index = frame;
  pose.procedure = 1;
  pose.map_id = 3;
  pose.map_epoch = 2;
  pose.state = HAUSTRA_STATE_TRACKING;
  pose.flags = HAUSTRA_POSE_VALID;
  pose.position_mu[0] = static_cast<double>(frame);
  pose.orientation_xyzw[3] = 1.0;
  pose.num_features = 500;
  pose.num_inliers = 120;
  return pose;
}

class LiveStreamTest : public ::testing::Test {
 protected:
  std::unique_ptr<PoseRingWriter> MakeWriter() const {
    Result<std::unique_ptr<PoseRingWriter>> writer =
        PoseRingWriter::Create(folder_.At("poses"), 0600, static_cast<gid_t>(-1));
    EXPECT_TRUE(writer.ok()) << writer.status().message();
    (*writer)->SetService(HAUSTRA_SERVICE_RUNNING);
    (*writer)->SetProcedure(1);
    (*writer)->Beat();
    return std::move(*writer);
  }
  std::string Root() const { return folder_.At(""); }
  // Lives as long as the fixture.
  Frame GreyFrame(std::uint32_t index) const {
    Frame frame;
    frame.index = index;
    frame.image = {pixels_.data(), 720, 540, 720, PixelFormat::kGrey8};
    return frame;
  }

  evaluate::TextFolder folder_;
  std::vector<std::uint8_t> pixels_ = std::vector<std::uint8_t>(720 * 540, 90);
};

TEST_F(LiveStreamTest, WithoutAnEngineItSaysSoOnce) {
  LiveStream stream(Root());
  const std::vector<nlohmann::json> service = Messages(stream.Next(), "service");
  ASSERT_EQ(service.size(), 1u);
  EXPECT_EQ(service[0]["state"], "none");
  EXPECT_EQ(service[0]["has_engine"], false);
  EXPECT_EQ(service[0]["text"], "No engine is running.");
  EXPECT_EQ(stream.Next(), "");
}

TEST_F(LiveStreamTest, PosesComeInOrderAndOnce) {
  const auto writer = MakeWriter();
  for (std::uint64_t frame = 1; frame <= 3; ++frame) writer->PublishPose(PoseAt(frame));
  LiveStream stream(Root());
  const std::string news = stream.Next();
  EXPECT_EQ(Messages(news, "fresh").size(), 1u);
  EXPECT_EQ(Messages(news, "service").at(0)["state"], "running");
  EXPECT_EQ(Messages(news, "service").at(0)["has_engine"], true);
  const nlohmann::json poses = Messages(news, "poses").at(0);
  ASSERT_EQ(poses.size(), 3u);
  EXPECT_EQ(poses[0]["frame"], 1);
  EXPECT_EQ(poses[2]["frame"], 3);
  EXPECT_EQ(poses[2]["t_s"], 0.12);
  EXPECT_EQ(poses[2]["published_ms"], 12.5);
  EXPECT_EQ(poses[2]["state"], "tracking");
  EXPECT_EQ(poses[2]["map"], 3);
  EXPECT_EQ(poses[2]["position"], nlohmann::json({3.0, 0.0, 0.0}));
  EXPECT_EQ(stream.Next(), "");
  haustra_pose lost = PoseAt(4);
  lost.state = HAUSTRA_STATE_LOST;
  lost.reason = HAUSTRA_REASON_FEW_MATCHES;
  lost.flags = 0;
  lost.map_id = HAUSTRA_NO_MAP;
  writer->PublishPose(lost);
  const nlohmann::json more = Messages(stream.Next(), "poses").at(0);
  ASSERT_EQ(more.size(), 1u);
  EXPECT_EQ(more[0]["state"], "lost");
  EXPECT_EQ(more[0]["reason"], "few_matches");
  EXPECT_EQ(more[0]["map"], -1);
  EXPECT_FALSE(more[0].contains("position"));
}

TEST_F(LiveStreamTest, EventsAndTheMapAreTold) {
  const auto writer = MakeWriter();
  haustra_event event{};
  event.kind = HAUSTRA_EVENT_MERGED;
  event.map_id = 0;
  event.other_map_id = 1;
  event.num_keyframes = 12;
  writer->PublishEvent(event);
  event.kind = HAUSTRA_EVENT_MERGE_REJECTED;
  writer->PublishEvent(event);
  const auto snapshot = std::make_unique<haustra_snapshot>();
  snapshot->map_id = 0;
  snapshot->procedure = 1;
  snapshot->num_points = snapshot->num_map_points = 2;
  snapshot->num_keyframes = snapshot->num_map_keyframes = 1;
  snapshot->num_maps = 1;
  snapshot->points[1].position_mu[2] = 5.0f;
  writer->PublishSnapshot(*snapshot);
  LiveStream stream(Root());
  const std::string news = stream.Next();
  const nlohmann::json events = Messages(news, "events").at(0);
  ASSERT_EQ(events.size(), 1u) << "what was turned down is not news";
  EXPECT_EQ(events[0]["event"], "merged");
  EXPECT_EQ(events[0]["other_map"], 1);
  const nlohmann::json map = Messages(news, "map").at(0);
  EXPECT_EQ(map["num_points"], 2);
  EXPECT_EQ(map["procedure"], 1);
  EXPECT_EQ(map["points"].get<std::string>().size(), 32u) << "24 bytes in base64";
  // The same map is not told twice, and a newer one not at once.
  writer->PublishSnapshot(*snapshot);
  EXPECT_TRUE(Messages(stream.Next(), "map").empty());
}

TEST_F(LiveStreamTest, APictureIsToldWithItsMatchesOnceItsFrameIsAnswered) {
  const auto writer = MakeWriter();
  const auto view = ViewRingWriter::Create(folder_.At("view"), 0600, static_cast<gid_t>(-1));
  ASSERT_TRUE(view.ok()) << view.status().message();
  Frame frame = GreyFrame(7);
  (*view)->PublishPicture(frame, 1);
  LiveStream stream(Root());
  EXPECT_TRUE(Messages(stream.Next(), "picture").empty()) << "tracking is at work on it";
  (*view)->PublishMatches(7, 1, std::vector<haustra_match>{{100.0F, 50.0F}, {719.0F, 539.0F}}, 2);
  const nlohmann::json picture = Messages(stream.Next(), "picture").at(0);
  EXPECT_EQ(picture["frame"], 7);
  EXPECT_EQ(picture["procedure"], 1);
  EXPECT_EQ(picture["width"], 360);
  EXPECT_EQ(picture["height"], 270);
  EXPECT_EQ(picture["num_matched"], 2);
  EXPECT_EQ(picture["points"], nlohmann::json({50.0, 25.0, 359.5, 269.5}));
  EXPECT_TRUE(picture["jpeg"].get<std::string>().starts_with("/9j/")) << "ff d8 ff";
  EXPECT_TRUE(Messages(stream.Next(), "picture").empty()) << "it was told";
  // One that tracking has left out.
  frame.index = 9;
  (*view)->PublishPicture(frame, 1);
  (*view)->PublishMatches(8, 1, {}, 0);
  (*view)->PublishMatches(10, 1, {}, 0);
  EXPECT_EQ(Messages(stream.Next(), "picture").at(0)["num_matched"], 0);
}

// A former service has left its file.
TEST_F(LiveStreamTest, PicturesOfAnotherProcedureAreNotTold) {
  const auto writer = MakeWriter();
  const auto view = ViewRingWriter::Create(folder_.At("view"), 0600, static_cast<gid_t>(-1));
  ASSERT_TRUE(view.ok()) << view.status().message();
  Frame frame = GreyFrame(7);
  (*view)->PublishPicture(frame, 5);
  (*view)->PublishMatches(7, 5, {}, 0);
  LiveStream stream(Root());
  EXPECT_TRUE(Messages(stream.Next(), "picture").empty());
  frame.index = 8;
  (*view)->PublishPicture(frame, 1);
  (*view)->PublishMatches(8, 1, {}, 0);
  EXPECT_EQ(Messages(stream.Next(), "picture").at(0)["frame"], 8);
}

// A mark of the active map with a label that is HTML, one of another map, and one that the snapshot does not know yet.
TEST_F(LiveStreamTest, MarksComeWithTheMapThePosesAndTheirPicture) {
  const auto writer = MakeWriter();
  const auto view = ViewRingWriter::Create(folder_.At("view"), 0600, static_cast<gid_t>(-1));
  ASSERT_TRUE(view.ok()) << view.status().message();
  const auto snapshot = std::make_unique<haustra_snapshot>();
  snapshot->map_id = 3;
  snapshot->procedure = 1;
  snapshot->num_marks = 2;
  snapshot->marks[0] = {5, 3, 0, 4, {1.0F, 2.0F, 3.5F}, 0, "<b>&\"x"};
  snapshot->marks[1] = {6, 1, 0, 2, {0.0F, 0.0F, 0.0F}, 0, "other"};
  writer->PublishSnapshot(*snapshot);
  Frame frame = GreyFrame(7);
  (*view)->PublishPicture(frame, 1);
  haustra_pose pose = PoseAt(7);
  pose.num_marks = 4;
  pose.marks[0] = {5, HAUSTRA_MARK_IN_FRONT, 101.0F, 50.0F, 1.256F, 0};
  pose.marks[1] = {7, HAUSTRA_MARK_HIDDEN, 300.0F, 200.0F, 2.0F, 0};
  pose.marks[2] = {8, HAUSTRA_MARK_UNSURE, 719.0F, 539.0F, 0.5F, 0};
  pose.marks[3] = {9, HAUSTRA_MARK_OUT_OF_VIEW, 0.0F, 0.0F, 3.0F, 0};
  writer->PublishPose(pose);
  // Newer poses have their own.
  writer->PublishPose(PoseAt(8));
  (*view)->PublishMatches(7, 1, {}, 0);
  LiveStream stream(Root());
  const std::string news = stream.Next();
  EXPECT_EQ(Messages(news, "map").at(0)["marks"],
            nlohmann::json::parse(R"([{"id": 5, "label": "<b>&\"x", "map": 3, "position": [1.0, 2.0, 3.5]},
                                      {"id": 6, "label": "other", "map": 1, "position": [0.0, 0.0, 0.0]}])"));
  const nlohmann::json poses = Messages(news, "poses").at(0);
  ASSERT_EQ(poses[0]["marks"].size(), 4u);
  EXPECT_EQ(poses[0]["marks"][0], nlohmann::json({{"id", 5}, {"state", "in_front"}, {"distance", 1.26}}));
  EXPECT_EQ(poses[0]["marks"][1]["state"], "hidden");
  EXPECT_FALSE(poses[1].contains("marks"));
  // Every second pixel; what cannot be seen is not told.
  EXPECT_EQ(Messages(news, "picture").at(0)["marks"],
            nlohmann::json::parse(R"([{"id": 5, "state": "in_front", "x": 50.5, "y": 25.0},
                                      {"id": 8, "state": "unsure", "x": 359.5, "y": 269.5}])"));
  // A frame that was left out has no pose, and so no marks.
  frame.index = 9;
  (*view)->PublishPicture(frame, 1);
  (*view)->PublishMatches(8, 1, {}, 0);
  (*view)->PublishMatches(10, 1, {}, 0);
  EXPECT_TRUE(Messages(stream.Next(), "picture").at(0)["marks"].empty());
}

TEST_F(LiveStreamTest, ViewersDoNotTakeFromEachOther) {
  const auto writer = MakeWriter();
  LiveStream first(Root()), second(Root());
  writer->PublishPose(PoseAt(1));
  EXPECT_EQ(Messages(first.Next(), "poses").size(), 1u);
  EXPECT_EQ(Messages(second.Next(), "poses").size(), 1u);
}

TEST_F(LiveStreamTest, ARestartIsFollowed) {
  auto writer = MakeWriter();
  writer->PublishPose(PoseAt(1));
  LiveStream stream(Root());
  stream.Next();
  writer.reset();
  const std::string gone = stream.Next();
  EXPECT_EQ(Messages(gone, "service").at(0)["state"], "closed");
  EXPECT_EQ(Messages(gone, "fresh").size(), 1u) << "what was shown was a patient's";
  EXPECT_EQ(stream.Next(), "");
  writer = MakeWriter();
  writer->PublishPose(PoseAt(9));
  const std::string back = stream.Next();
  EXPECT_EQ(Messages(back, "fresh").size(), 1u);
  EXPECT_EQ(Messages(back, "service").at(0)["state"], "running");
  EXPECT_EQ(Messages(back, "poses").at(0).at(0)["frame"], 9);
}

TEST_F(LiveStreamTest, TheEndOfAProcedureIsForgotten) {
  const auto writer = MakeWriter();
  writer->PublishPose(PoseAt(1));
  LiveStream stream(Root());
  stream.Next();
  writer->SetService(HAUSTRA_SERVICE_IDLE);
  writer->Wipe();
  const std::string over = stream.Next();
  EXPECT_EQ(Messages(over, "fresh").size(), 1u);
  EXPECT_EQ(Messages(over, "service").at(0)["state"], "idle");
  EXPECT_TRUE(Messages(over, "poses").empty());
  writer->SetProcedure(2);
  writer->SetService(HAUSTRA_SERVICE_RUNNING);
  haustra_pose pose = PoseAt(2);
  pose.procedure = 2;
  writer->PublishPose(pose);
  const std::string next = stream.Next();
  EXPECT_EQ(Messages(next, "service").at(0)["has_engine"], true);
  EXPECT_EQ(Messages(next, "poses").size(), 1u);
}

// Its files could not be wiped.
TEST_F(LiveStreamTest, WhatAnEndedProcedureLeftIsNotToldAgain) {
  const auto writer = MakeWriter();
  const auto snapshot = std::make_unique<haustra_snapshot>();
  snapshot->procedure = 1;
  writer->PublishSnapshot(*snapshot);
  LiveStream stream(Root());
  EXPECT_EQ(Messages(stream.Next(), "map").size(), 1u);
  writer->PublishPose(PoseAt(1));
  writer->SetService(HAUSTRA_SERVICE_IDLE);
  const std::string over = stream.Next() + stream.Next();
  EXPECT_EQ(Messages(over, "fresh").size(), 1u);
  EXPECT_TRUE(Messages(over, "map").empty());
  EXPECT_TRUE(Messages(over, "poses").empty());
  writer->PublishPose(PoseAt(2));
  writer->SetProcedure(2);
  writer->SetService(HAUSTRA_SERVICE_RUNNING);
  const std::string next = stream.Next() + stream.Next();
  EXPECT_TRUE(Messages(next, "map").empty());
  EXPECT_TRUE(Messages(next, "poses").empty());
  haustra_pose pose = PoseAt(3);
  pose.procedure = snapshot->procedure = 2;
  writer->PublishPose(pose);
  writer->PublishSnapshot(*snapshot);
  EXPECT_EQ(Messages(stream.Next(), "poses").size(), 1u);
}

// The service has begun to map, and does not say so yet.
TEST_F(LiveStreamTest, MapOfAServiceThatIsJustStartingIsToldLater) {
  const auto writer = MakeWriter();
  writer->SetService(HAUSTRA_SERVICE_IDLE);
  LiveStream stream(Root());
  EXPECT_TRUE(Messages(stream.Next(), "map").empty());
  writer->SetProcedure(2);
  const auto snapshot = std::make_unique<haustra_snapshot>();
  snapshot->procedure = 2;
  writer->PublishSnapshot(*snapshot);
  EXPECT_TRUE(Messages(stream.Next(), "map").empty());
  writer->SetService(HAUSTRA_SERVICE_RUNNING);
  EXPECT_EQ(Messages(stream.Next(), "map").size(), 1u);
}

TEST_F(LiveStreamTest, AnotherFileIsNamed) {
  folder_.Write("poses", std::string(500, 'x'));
  LiveStream stream(Root());
  const nlohmann::json service = Messages(stream.Next(), "service").at(0);
  EXPECT_EQ(service["state"], "none");
  EXPECT_THAT(service["text"].get<std::string>(), ::testing::HasSubstr("poses is not what haustrad writes."));
}

}  // namespace
}  // namespace haustra::view
