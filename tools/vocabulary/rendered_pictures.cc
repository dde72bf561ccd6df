#include "tools/vocabulary/rendered_pictures.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "capture/image.h"
#include "tools/command/parallel_for.h"
#include "tools/render/exposure.h"
#include "tools/render/sequence_model.h"

namespace haustra {
namespace {

// Still apart from small seeds when only 32 bits are looked at.
constexpr std::uint64_t kFirstSeed = 4000000000;
// Mucosa from rich to poor in texture, rigid and breathing.
constexpr std::string_view kPresets[] = {"clear", "losses", "breathing", "silicone"};

}  // namespace

Status RenderPictures(const RenderedPicturesOptions& options, const RenderedPicturesReceiver& receiver) {
  for (int colon = 0; colon < options.num_colons; ++colon) {
    HAUSTRA_ASSIGN(const render::Preset preset,
                   render::FindPreset(kPresets[static_cast<std::size_t>(colon) % std::size(kPresets)]));
    render::RenderOptions render_options = render::RenderOptions::FromPreset(preset);
    render_options.seed = kFirstSeed + static_cast<std::uint64_t>(colon);
    render_options.events.clear();
    HAUSTRA_ASSIGN(const std::unique_ptr<render::SequenceModel> model, render::SequenceModel::Create(render_options));
    HAUSTRA_TRY(receiver.begin_colon(model->camera().calibration(), model->window().mask()));

    std::vector<std::unique_ptr<render::FrameRenderer>> renderers;
    for (int i = 0; i < options.num_threads; ++i) {
      renderers.push_back(
          std::make_unique<render::FrameRenderer>(model->colon(), model->mucosa(), model->camera(), model->window()));
    }
    std::vector<render::LinearImage> light(options.num_threads,
                                           render::LinearImage(render_options.width_px, render_options.height_px));
    std::vector<Image> pictures(options.num_threads);
    const int num_frames = render_options.num_frames();
    const int num_pictures = std::min(options.pictures_per_colon, num_frames);
    for (int begin = 0; begin < num_pictures; begin += options.num_threads) {
      const int count = std::min(options.num_threads, num_pictures - begin);
      ParallelFor(count, options.num_threads, [&](int i, int worker) {
        const auto frame = static_cast<int>(std::int64_t{begin + i} * num_frames / num_pictures);
        model->Expose(frame, renderers[worker].get(), &light[i]);
        // Each on its own: the exposure that a scope resting there would have settled at.
        render::AutoExposure exposure;
        exposure.Start(render::Meter(light[i], model->window()));
        model->sensor().Develop(exposure.gain(), frame, &light[i], &pictures[i]);
      });
      for (int i = 0; i < count; ++i) HAUSTRA_TRY(receiver.add_picture(pictures[i].view()));
    }
  }
  return Status::Ok();
}

}  // namespace haustra
