#include "tools/report/join_pictures.h"

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <pugixml.hpp>
#include <set>
#include <sstream>
#include <system_error>
#include <vector>

#include "capture/codec/jpeg_codec.h"
#include "capture/dataset/endomapper.h"
#include "capture/image_transform.h"
#include "capture/open_sequence.h"
#include "tools/evaluate/number_text.h"
#include "tools/evaluate/sequence_of_run.h"
#include "tools/report/base64.h"
#include "tools/report/html_text.h"

namespace haustra::report {
namespace {

using evaluate::Fixed;
using evaluate::RunEventRow;
using evaluate::RunOutput;

constexpr int kMaxWidthPx = 800;  // larger frames are halved
constexpr int kQuality = 80;
constexpr int kGapPx = 8;
constexpr std::size_t kMaxLines = 120;

struct Picture {
  std::string data;  // base64 of a JPEG
  int width_px = 0;
  int height_px = 0;
};

// A frame of the sequence, small enough for a page.
Result<Picture> MakePicture(const RunOutput& run, const Frame& frame, std::int64_t frame_idx,
                            const PictureOptions& options) {
  HAUSTRA_TRY(evaluate::CheckIsOfRun(run, frame_idx, frame.timestamp, options.sequence));
  Image image, half;
  CopyImage(frame.image, &image);
  while (image.width() > kMaxWidthPx) {
    HalveImage(image.view(), &half);
    std::swap(image, half);
  }
  std::vector<std::uint8_t> jpeg;
  HAUSTRA_TRY(capture::internal::EncodeJpeg(image.view(), kQuality, &jpeg));
  return Picture{ToBase64(jpeg), image.width(), image.height()};
}

// The pictures of these frames. Image files are opened one by one; a recording is read once, up to the last of them.
Result<std::map<std::int64_t, Picture>> ReadPictures(const RunOutput& run, const std::set<std::int64_t>& frames,
                                                     const PictureOptions& options) {
  std::map<std::int64_t, Picture> pictures;
  SequenceOptions choice = evaluate::OptionsForPictures(run);
  choice.deinterlace = options.deinterlace;
  if (frames.empty()) {
    // A name that is wrong is said here, too, and not when a run has joins.
    HAUSTRA_TRY(OpenSequence(options.sequence, choice).status());
    return pictures;
  }
  std::error_code error;
  if (std::filesystem::is_directory(options.sequence, error) && !LooksLikeEndomapper(options.sequence)) {
    for (const std::int64_t frame_idx : frames) {
      choice.first_frame = choice.last_frame = static_cast<std::uint32_t>(run.figures.part.StoredFrame(frame_idx));
      HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, OpenSequence(options.sequence, choice));
      HAUSTRA_ASSIGN(const Frame frame, source->Next(kNoDeadline));
      HAUSTRA_ASSIGN(pictures[frame_idx], MakePicture(run, frame, frame_idx, options));
    }
    return pictures;
  }
  HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, OpenSequence(options.sequence, choice));
  while (pictures.size() < frames.size()) {
    const Result<Frame> frame = source->Next(kNoDeadline);
    if (frame.code() == StatusCode::kDataLoss) continue;
    if (frame.code() == StatusCode::kNotFound) {
      const auto missing = std::find_if(frames.begin(), frames.end(), [&](auto f) { return !pictures.contains(f); });
      return InvalidArgument(options.sequence + ": has no frame " +
                             std::to_string(run.figures.part.StoredFrame(*missing)) + ": not the sequence of this run");
    }
    HAUSTRA_TRY(frame.status());
    if (!frames.contains(frame->index)) continue;
    HAUSTRA_ASSIGN(pictures[frame->index], MakePicture(run, *frame, frame->index, options));
  }
  return pictures;
}

struct PixelPair {
  Eigen::Vector2d a, b;
};

struct SharedPoints {
  bool are_known = false;  // both keyframes are in the final map
  std::size_t num = 0;
  std::vector<PixelPair> shown;
};

SharedPoints FindSharedPoints(const std::map<int, MapModel>& models, std::int64_t keyframe_a, std::int64_t keyframe_b) {
  SharedPoints shared;
  for (const auto& [map_id, model] : models) {
    const auto a = model.keyframes.find(keyframe_a), b = model.keyframes.find(keyframe_b);
    if (a == model.keyframes.end() || b == model.keyframes.end()) continue;
    shared.are_known = true;
    std::vector<PixelPair> pairs;
    for (const auto& [point_id, pixel] : a->second.pixels) {
      const auto other = b->second.pixels.find(point_id);
      if (other != b->second.pixels.end()) pairs.push_back({pixel, other->second});
    }
    shared.num = pairs.size();
    const std::size_t step = std::max<std::size_t>(1, (pairs.size() + kMaxLines - 1) / kMaxLines);
    for (std::size_t i = 0; i < pairs.size(); i += step) shared.shown.push_back(pairs[i]);
    break;
  }
  return shared;
}

void AddImage(const Picture& picture, int x_px, pugi::xml_node* svg) {
  pugi::xml_node image = svg->append_child("image");
  image.append_attribute("x") = x_px;
  image.append_attribute("y") = 0;
  image.append_attribute("width") = picture.width_px;
  image.append_attribute("height") = picture.height_px;
  image.append_attribute("href") = ("data:image/jpeg;base64," + picture.data).c_str();
}

void AddDot(const std::string& x, const std::string& y, pugi::xml_node* svg) {
  pugi::xml_node dot = svg->append_child("circle");
  dot.append_attribute("cx") = x.c_str();
  dot.append_attribute("cy") = y.c_str();
  dot.append_attribute("r") = "2.5";
}

// Both pictures with the lines between them. camera_width_px: of the pixels of `shared`.
std::string PairSvg(const Picture& a, const std::optional<Picture>& b, const SharedPoints& shared,
                    int camera_width_px) {
  const int offset_px = a.width_px + kGapPx;
  const int width_px = offset_px + (b ? b->width_px : a.width_px);
  const int height_px = std::max(a.height_px, b ? b->height_px : 0);
  pugi::xml_document document;
  pugi::xml_node svg = document.append_child("svg");
  svg.append_attribute("class") = "pair";
  svg.append_attribute("viewBox") = ("0 0 " + std::to_string(width_px) + " " + std::to_string(height_px)).c_str();
  svg.append_attribute("role") = "img";
  AddImage(a, 0, &svg);
  if (b) {
    AddImage(*b, offset_px, &svg);
    const double scale = camera_width_px > 0 ? static_cast<double>(a.width_px) / camera_width_px : 1.0;
    for (const PixelPair& pair : shared.shown) {
      const std::string xa = Fixed(scale * pair.a.x(), 1), ya = Fixed(scale * pair.a.y(), 1);
      const std::string xb = Fixed(offset_px + scale * pair.b.x(), 1), yb = Fixed(scale * pair.b.y(), 1);
      pugi::xml_node line = svg.append_child("line");
      line.append_attribute("x1") = xa.c_str();
      line.append_attribute("y1") = ya.c_str();
      line.append_attribute("x2") = xb.c_str();
      line.append_attribute("y2") = yb.c_str();
      AddDot(xa, ya, &svg);
      AddDot(xb, yb, &svg);
    }
  }
  std::ostringstream text;
  document.save(text, "", pugi::format_raw | pugi::format_no_declaration);
  return text.str();
}

std::string FigureHtml(const RunEventRow& event, const evaluate::JoinEvaluation& join,
                       const std::map<int, MapModel>& models, int camera_width_px,
                       const std::map<std::int64_t, Picture>& pictures) {
  // A keyframe of a loaded atlas was seen in another sequence.
  const std::optional<std::int64_t> other_frame = DetailOf(event, "other_frame");
  std::optional<Picture> second;
  if (other_frame) second = pictures.at(*other_frame);
  const std::optional<std::int64_t> keyframe = DetailOf(event, "keyframe");
  SharedPoints shared;
  if (keyframe && event.other_keyframe_id) shared = FindSharedPoints(models, *keyframe, *event.other_keyframe_id);

  std::string caption = std::string(ToString(join.kind)) + " at frame " + std::to_string(event.frame_idx);
  caption += ": map " + std::to_string(join.map_id);
  if (join.other_map_id >= 0) caption += " and map " + std::to_string(join.other_map_id);
  caption +=
      other_frame ? "; right: frame " + std::to_string(*other_frame) : "; the frame that it met is not one of this run";
  caption += ". By the ground truth: " + std::string(ToString(join.verdict));
  if (!join.reason.empty()) caption += " (" + join.reason + ")";
  caption += ". ";
  if (shared.are_known) {
    caption += std::to_string(shared.num) + " map points are seen by both keyframes in the final map";
    if (shared.shown.size() < shared.num) caption += ", " + std::to_string(shared.shown.size()) + " of them drawn";
  } else {
    caption += "One of the two keyframes is not in the final map (culled), so no matches can be drawn";
  }
  caption += ". Engine: " + event.details + ".";
  return "<figure>\n" + PairSvg(pictures.at(event.frame_idx), second, shared, camera_width_px) + "<figcaption>" +
         EscapeHtml(caption) + "</figcaption>\n</figure>\n";
}

}  // namespace

Result<std::string> JoinPicturesHtml(const RunOutput& run, const evaluate::Evaluation& evaluation,
                                     const std::map<int, MapModel>& models, const PictureOptions& options) {
  struct Join {
    const RunEventRow* event;
    const evaluate::JoinEvaluation* join;
  };
  // The evaluation has one entry for each of these events, in order, and others.
  std::vector<Join> joins;
  auto next = evaluation.joins.begin();
  for (const RunEventRow& event : run.events) {
    if (event.event != "merged" && event.event != "loop_closed") continue;
    next = std::find_if(next, evaluation.joins.end(), [](const evaluate::JoinEvaluation& join) {
      return join.kind == evaluate::JoinKind::kMerge || join.kind == evaluate::JoinKind::kLoop;
    });
    HAUSTRA_CHECK(next != evaluation.joins.end());
    joins.push_back({&event, &*next++});
  }
  const int camera_width_px = run.geometry.empty() ? 0 : run.geometry.begin()->second.camera.width_px;
  const std::size_t step = std::max<std::size_t>(1, (joins.size() + options.max_joins - 1) / options.max_joins);
  std::vector<Join> shown;
  std::set<std::int64_t> frames;
  for (std::size_t i = 0; i < joins.size(); i += step) {
    shown.push_back(joins[i]);
    frames.insert(joins[i].event->frame_idx);
    if (const auto other_frame = DetailOf(*joins[i].event, "other_frame")) frames.insert(*other_frame);
  }
  HAUSTRA_ASSIGN(const auto pictures, ReadPictures(run, frames, options));
  std::string html;
  for (const Join& join : shown) html += FigureHtml(*join.event, *join.join, models, camera_width_px, pictures);
  if (joins.empty()) html += "<p>No maps were merged and no loop was closed.</p>\n";
  if (shown.size() < joins.size()) {
    html +=
        "<p>" + std::to_string(shown.size()) + " of " + std::to_string(joins.size()) + " shown (--max-pictures).</p>\n";
  }
  return html;
}

}  // namespace haustra::report
