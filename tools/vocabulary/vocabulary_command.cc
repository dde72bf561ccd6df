#include "tools/vocabulary/vocabulary_command.h"

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "capture/files/file_sink.h"
#include "engine/place/vocabulary_file.h"
#include "platform/config/engine_config_table.h"
#include "tools/command/common_options.h"
#include "tools/command/console.h"
#include "tools/command/missing_calibration.h"
#include "tools/command/number_checks.h"
#include "tools/command/output_folder.h"
#include "tools/command/stop_signal.h"
#include "tools/exit_codes.h"
#include "tools/vocabulary/rendered_pictures.h"
#include "tools/vocabulary/training_sample.h"

namespace haustra {
namespace {

constexpr const char* kVocabularyCommand = "vocabulary";

struct VocabularyArguments {
  std::string out;
  std::vector<std::string> sequences;
  int every_nth = 10;
  RenderedPicturesOptions rendered{.num_colons = 0, .pictures_per_colon = 25, .num_threads = 1};
  int features = 800;
  VocabularyOptions options;
  std::string config;
  std::vector<std::string> assignments;
  int threads = 0;
  bool overwrite = false;
};

Status Gather(const VocabularyArguments& arguments, TrainingSample* sample) {
  for (const std::string& sequence : arguments.sequences) {
    const std::size_t before = sample->num_pictures();
    const Status status = sample->AddSequence(sequence, arguments.every_nth);
    if (!status.ok()) return WithCalibrationAdvice(status, sequence, {});
    console::Tell("%s: %zu pictures\n", sequence.c_str(), sample->num_pictures() - before);
  }
  if (arguments.rendered.num_colons == 0) return Status::Ok();
  RenderedPicturesReceiver receiver;
  receiver.begin_colon = [&](const CameraCalibration& calibration, ImageView mask) {
    return sample->BeginSource(calibration, mask);
  };
  receiver.add_picture = [&](ImageView picture) { return sample->AddPicture(picture); };
  const std::size_t before = sample->num_pictures();
  HAUSTRA_TRY(RenderPictures(arguments.rendered, receiver));
  console::Tell("%d rendered colons: %zu pictures\n", arguments.rendered.num_colons, sample->num_pictures() - before);
  return Status::Ok();
}

int RunVocabulary(VocabularyArguments arguments) {
  if (arguments.sequences.empty() && arguments.rendered.num_colons == 0) {
    return console::Fail(kVocabularyCommand, InvalidArgument("nothing to learn from: name sequences, or --rendered N"),
                         kExitUsage);
  }
  const FileContent content{"a vocabulary of haustra", {kVocabularyFile.magic}};
  const Status writable = CheckOutputFile(arguments.out, content, arguments.overwrite, arguments.sequences);
  if (!writable.ok()) {
    return console::FailWriting(kVocabularyCommand, writable);
  }
  const Result<ConfigStore<EngineConfig>> config = LoadEngineConfig(arguments.config, arguments.assignments);
  if (!config.ok()) return console::Fail(kVocabularyCommand, config.status(), kExitConfig);
  arguments.options.root_sift = config->config().features.root_sift;
  arguments.rendered.num_threads =
      arguments.threads > 0 ? arguments.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  // Where nothing can be written, nobody waits for the training.
  if (const Status status = FileSink::Create(arguments.out).status(); !status.ok()) {
    return console::FailWriting(kVocabularyCommand, status);
  }

  const auto start = std::chrono::steady_clock::now();
  const auto elapsed_s = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  TrainingSample sample(config->config(), arguments.features, arguments.threads);
  if (const Status status = Gather(arguments, &sample); !status.ok()) return console::Fail(kVocabularyCommand, status);
  const double gathered_s = elapsed_s();
  const Result<Vocabulary> vocabulary = Vocabulary::Train(sample.sample(), arguments.options);
  if (!vocabulary.ok()) return console::Fail(kVocabularyCommand, vocabulary.status());
  CatchStopSignals();  // it is written to its end
  Result<FileSink> sink = FileSink::Create(arguments.out);
  if (!sink.ok()) return console::FailWriting(kVocabularyCommand, sink.status());
  if (const Status status = WriteVocabulary(*vocabulary, *sink); !status.ok())
    return console::FailWriting(kVocabularyCommand, status);
  if (const Status status = sink->Commit(); !status.ok()) return console::FailWriting(kVocabularyCommand, status);
  console::Tell("%s: %d words from %zu descriptors of %zu pictures, %.1f s (%.1f s of them training)\n",
                arguments.out.c_str(), vocabulary->num_words(), sample.sample().num_descriptors(),
                sample.num_pictures(), elapsed_s(), elapsed_s() - gathered_s);
  return kExitOk;
}

}  // namespace

void AddVocabularyCommand(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<VocabularyArguments>();
  CLI::App* command = app.add_subcommand("vocabulary", "Learn the visual words for retrieval.kind=vocabulary");
  command->add_option("sequences", arguments->sequences, "Sequences to learn from, as for `haustra run`");
  command->add_option("--out", arguments->out, "File to write, for retrieval.vocabulary")->required();
  AddOverwriteFlag(*command, arguments->overwrite);
  command->add_option("--every-nth", arguments->every_nth, "Of each sequence, use every n-th frame")
      ->transform(WholeNumberBetween(1, 100000))
      ->capture_default_str();
  command->add_option("--rendered", arguments->rendered.num_colons, "Colons to render and learn from")
      ->transform(WholeNumberBetween(0, 1000))
      ->capture_default_str();
  command->add_option("--pictures", arguments->rendered.pictures_per_colon, "Pictures of each rendered colon")
      ->transform(WholeNumberBetween(1, 10000))
      ->capture_default_str();
  command->add_option("--features", arguments->features, "Strongest features of each picture that are learnt from")
      ->transform(WholeNumberBetween(16, 8000))
      ->capture_default_str();
  command->add_option("--branching", arguments->options.branching, "Children of a node of the tree")
      ->transform(WholeNumberBetween(Vocabulary::kMinBranching, Vocabulary::kMaxBranching))
      ->capture_default_str();
  command->add_option("--depth", arguments->options.depth, "Levels of the tree")
      ->transform(WholeNumberBetween(1, Vocabulary::kMaxDepth))
      ->capture_default_str();
  command->add_option("--seed", arguments->options.seed, "Seed of the clustering")
      ->transform(WholeNumber<std::uint64_t>())
      ->capture_default_str();
  command->add_option("--config", arguments->config, "Configuration file (YAML): its features are those of the words");
  command->add_option("--set", arguments->assignments, "Overrides one key of the configuration: section.key=value")
      ->allow_extra_args(false);
  command->add_option("--threads", arguments->threads, "Threads, 0: one a core. The words do not depend on it")
      ->transform(WholeNumberBetween(0, 256))
      ->capture_default_str();
  command->callback([arguments, &action] { action = [arguments] { return RunVocabulary(*arguments); }; });
}

}  // namespace haustra
