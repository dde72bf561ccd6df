#include "tools/render/render_command.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "tools/command/common_options.h"
#include "tools/command/console.h"
#include "tools/command/number_checks.h"
#include "tools/command/progress_line.h"
#include "tools/command/stop_signal.h"
#include "tools/exit_codes.h"
#include "tools/render/render_sequence.h"

namespace haustra {
namespace {

constexpr const char* kRenderCommand = "render";

struct RenderArguments {
  std::string out;
  std::string preset = "standard";
  std::string size;
  std::string calibration_error;
  std::vector<std::string> events;
  std::optional<double> seconds, rate_hz;
  std::uint64_t seed = 1;
  std::optional<std::uint64_t> path_seed;
  std::optional<double> breathing_percent, contraction_percent, tangential_percent, remodel_percent;
  std::optional<double> collapse_percent, collapse_period_s, stool_percent, blood_percent, blood_s, fluid_percent;
  std::optional<int> lens_drops;
  std::optional<double> drop_size_percent;
  render::Shutter shutter;
  int threads = 0;
  int quality = 92;
  std::optional<double> tilt_deg;
  bool with_depth = false;
  bool with_normals = false;
  bool with_seen_wall = false;
  bool overwrite = false;
};

Status ParseSize(const std::string& text, render::RenderOptions* options) {
  int width = 0, height = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2) {
    return InvalidArgument("size '" + text + "' is not WIDTHxHEIGHT, like 720x540");
  }
  options->width_px = width;
  options->height_px = height;
  return Status::Ok();
}

Result<render::RenderOptions> OptionsFrom(const RenderArguments& arguments) {
  HAUSTRA_ASSIGN(const render::Preset preset, render::FindPreset(arguments.preset));
  render::RenderOptions options = render::RenderOptions::FromPreset(preset);
  if (arguments.seconds) options.seconds = *arguments.seconds;
  if (arguments.rate_hz) options.rate_hz = *arguments.rate_hz;
  if (!arguments.size.empty()) HAUSTRA_TRY(ParseSize(arguments.size, &options));
  options.seed = arguments.seed;
  options.path_seed = arguments.path_seed;
  options.jpeg_quality = arguments.quality;
  render::Breathing& breathing = options.preset.colon.breathing;
  if (arguments.breathing_percent) breathing.amplitude = *arguments.breathing_percent / 100.0;
  if (arguments.contraction_percent) breathing.wave_amplitude = *arguments.contraction_percent / 100.0;
  if (arguments.tangential_percent) breathing.tangential = *arguments.tangential_percent / 100.0;
  if (arguments.remodel_percent) options.preset.colon.remodel = *arguments.remodel_percent / 100.0;
  if (arguments.fluid_percent) options.preset.colon.fluid = *arguments.fluid_percent / 100.0;
  if (arguments.collapse_percent) breathing.pressure.collapse = *arguments.collapse_percent / 100.0;
  if (arguments.collapse_period_s) breathing.pressure.period_s = *arguments.collapse_period_s;
  render::MucosaStyle& mucosa = options.preset.mucosa;
  if (arguments.stool_percent) mucosa.stool = *arguments.stool_percent / 100.0;
  if (arguments.blood_percent) mucosa.blood.share = *arguments.blood_percent / 100.0;
  if (arguments.blood_s) mucosa.blood.spread_s = *arguments.blood_s;
  if (arguments.lens_drops) options.preset.lens_drops.count = *arguments.lens_drops;
  if (arguments.drop_size_percent) options.preset.lens_drops.size_percent = *arguments.drop_size_percent;
  options.shutter = arguments.shutter;
  if (!arguments.calibration_error.empty()) {
    HAUSTRA_ASSIGN(options.calibration_error, render::ParseCalibrationError(arguments.calibration_error));
  }
  if (arguments.tilt_deg) options.preset.path.tilt_deg = *arguments.tilt_deg;
  options.with_depth = arguments.with_depth;
  options.with_normals = arguments.with_normals;
  options.with_seen_wall = arguments.with_seen_wall;
  options.overwrite = arguments.overwrite;
  options.num_threads =
      arguments.threads > 0 ? arguments.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  options.events = render::PlaceEvents(preset.events, options.seconds);
  if (!arguments.events.empty()) {
    options.events.clear();
    for (const std::string& script : arguments.events) {
      HAUSTRA_ASSIGN(const std::vector<render::Event> events, render::ParseEvents(script));
      options.events.insert(options.events.end(), events.begin(), events.end());
    }
  }
  HAUSTRA_TRY(options.Validate());
  return options;
}

// As CLI11 describes a set, so that help, manual and completion have the kinds.
CLI::Validator EventScript() {
  std::string kinds;
  for (const std::string_view kind : render::EventKindNames()) kinds += std::string(kind) + "@,";
  return CLI::Validator([](const std::string& script) { return render::ParseEvents(script).status().message(); },
                        "{" + kinds + "none}");
}

int RunRender(const RenderArguments& arguments) {
  Result<render::RenderOptions> options = OptionsFrom(arguments);
  if (!options.ok()) return console::Fail(kRenderCommand, options.status(), kExitUsage);
  options->stop = &CatchStopSignals();
  ProgressLine line;
  const auto progress = [&line](int done, int total) {
    line.Update([&] {
      char text[80];
      std::snprintf(text, sizeof(text), "rendering %d / %d frames, %.1f frames/s", done, total,
                    done / line.elapsed_s());
      return std::string(text);
    });
  };
  const Status status = render::RenderSequence(arguments.out, *options, progress);
  line.Leave();
  if (!status.ok()) return console::FailWriting(kRenderCommand, status);
  console::Tell("%s: %d frames of %s, seed %llu, %zu event%s, %.1f s\n", arguments.out.c_str(), options->num_frames(),
                arguments.preset.c_str(), static_cast<unsigned long long>(arguments.seed), options->events.size(),
                options->events.size() == 1 ? "" : "s", line.elapsed_s());
  return kExitOk;
}

}  // namespace

void AddRenderCommand(CLI::App& app, std::function<int()>& action) {
  auto arguments = std::make_shared<RenderArguments>();
  CLI::App* command = app.add_subcommand("render", "Render a colon sequence with exact ground truth");
  std::string presets = "Kind of sequence:";
  std::vector<std::string> preset_names;
  for (const render::Preset& preset : render::Presets()) {
    preset_names.emplace_back(preset.name);
    presets += "\n  " + preset_names.back() + ": " + std::string(preset.summary);
  }
  command->add_option("OUT", arguments->out, "Folder to write the sequence to")->required();
  command->add_option("--preset", arguments->preset, presets)
      ->check(CLI::IsMember(preset_names))
      ->capture_default_str();
  command->add_option("--seconds", arguments->seconds, "Length; by default the preset's")
      ->check(NumberBetween(0.2, 3600.0));
  command->add_option("--rate", arguments->rate_hz, "Frames a second; by default the preset's")
      ->check(NumberBetween(1.0, 120.0));
  command->add_option("--size", arguments->size, "Picture size, like 720x540; by default the preset's")
      ->type_name("WIDTHxHEIGHT");
  command->add_option("--seed", arguments->seed, "Colon, mucosa and path")
      ->capture_default_str()
      ->transform(WholeNumber<std::uint64_t>());
  command
      ->add_option("--path-seed", arguments->path_seed,
                   "Path, events and noise: another procedure in the same colon; by default that of --seed")
      ->transform(WholeNumber<std::uint64_t>());
  command
      ->add_option(
          "--events", arguments->events,
          "Events instead of the preset's: kind@start_s[+duration_s], joined by commas or given again; or none")
      ->check(EventScript());
  command->add_option("--threads", arguments->threads, "Threads; 0: all cores. The pictures do not depend on it")
      ->transform(WholeNumberBetween(0, 256));
  command->add_option("--quality", arguments->quality, "JPEG quality: that of every picture of MJPEG")
      ->capture_default_str()
      ->transform(WholeNumberBetween(5, 100));
  command
      ->add_option("--breathing", arguments->breathing_percent,
                   "How much the radius swells with the breath, %; by default the preset's")
      ->check(NumberBetween(0.0, 15.0));
  command
      ->add_option("--contraction", arguments->contraction_percent,
                   "Depth of the travelling contraction, % of the radius; by default the preset's")
      ->check(NumberBetween(0.0, 15.0));
  command
      ->add_option("--tangential", arguments->tangential_percent,
                   "How far the wall slides along and about the lumen, % of the radius; by default 0")
      ->check(NumberBetween(0.0, 15.0));
  command
      ->add_option("--remodel", arguments->remodel_percent,
                   "The same colon another day: its radius differs by up to this from place to place, %; "
                   "drawn from --path-seed; by default 0")
      ->check(NumberBetween(0.0, 15.0));
  command
      ->add_option("--collapse", arguments->collapse_percent,
                   "The lumen closes as air is lost and is insufflated again, % of the radius; by default 0")
      ->check(NumberBetween(0.0, 40.0));
  command
      ->add_option("--collapse-period", arguments->collapse_period_s,
                   "From one insufflation to the next, s; by default 12")
      ->check(NumberBetween(2.0, 3600.0));
  command->add_option("--stool", arguments->stool_percent, "Film of stool, % of the wall; by default 0")
      ->check(NumberBetween(0.0, 100.0));
  command->add_option("--blood", arguments->blood_percent, "Blood, % of the wall in the end; by default 0")
      ->check(NumberBetween(0.0, 100.0));
  command
      ->add_option("--blood-spread", arguments->blood_s,
                   "Until blood has spread over its share, s; 0: from the start; by default 10")
      ->check(NumberBetween(0.0, 3600.0));
  command
      ->add_option("--fluid", arguments->fluid_percent,
                   "Pools of liquid on the low side of the colon, their depth in % of the radius; by default 0")
      ->check(NumberBetween(0.0, 100.0 * render::FluidLevel::kMaxShare));
  command->add_option("--lens-drops", arguments->lens_drops, "Drops that stay on the lens, at a time; by default 0")
      ->transform(WholeNumberBetween(0, 40));
  command
      ->add_option("--drop-size", arguments->drop_size_percent,
                   "Mean diameter of the drops, % of the picture's height; by default 12")
      ->check(NumberBetween(2.0, 40.0));
  command
      ->add_option("--exposure", arguments->shutter.exposure,
                   "Exposure of each row, share of the frame period; at least 1/500 s")
      ->check(NumberBetween(0.0, 1.0));
  command
      ->add_option("--readout", arguments->shutter.readout,
                   "Rolling shutter: from the first row to the last, share of the frame period")
      ->check(NumberBetween(0.0, 1.0));
  command
      ->add_option("--field-lag", arguments->shutter.field_lag,
                   "Odd rows are later by this share of the frame period; 0.5: interlaced video")
      ->check(NumberBetween(0.0, 0.5));
  command
      ->add_option("--calibration-error", arguments->calibration_error,
                   "calib.yaml is wrong by F % of the focal length, CX and CY pixels of the centre, K1 of the first "
                   "coefficient; calib_true.yaml is right")
      ->type_name("F[,CX,CY,K1]");
  command->add_flag("--depth", arguments->with_depth,
                    "Write true depth, too: depth/NNNNNN.pgm, the range along the ray at a quarter of the size");
  command->add_flag("--normals", arguments->with_normals,
                    "Write true normals, too: normals/NNNNNN.png, in the camera, at a quarter of the size");
  command->add_flag("--seen-wall", arguments->with_seen_wall,
                    "Write which part of the wall the frames show, too: seen_wall.csv");
  command
      ->add_option("--tilt", arguments->tilt_deg,
                   "A bent tip that looks so far from straight ahead, degrees; by default the preset's")
      ->check(NumberBetween(0.0, 90.0));
  AddOverwriteFlag(*command, arguments->overwrite);
  command->callback([arguments, &action] { action = [arguments] { return RunRender(*arguments); }; });
}

}  // namespace haustra
