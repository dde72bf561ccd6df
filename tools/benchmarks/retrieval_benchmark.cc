// Recall and time of both retrievals on sequences with ground truth.
//
//   haustra_retrieval_benchmark SEQUENCE... [--vocabulary FILE] [--every 8] [--distractors 2] [--gap 5]
//                               [--database 1200] [--depth 4] [--words 0] [--device cpu] [--set KEY=VALUE]
//
// Each SEQUENCE with a groundtruth.txt is tested in turn; the others are the rest of the atlas. Of the tested one every
// --every-th frame is a keyframe, of the others every --distractors-th, the clear ones, as many as make --database
// keyframes together. Each keyframe is a query for the keyframes that are at least --gap seconds older. It counts when
// one of these truly shares a view with it (tools/evaluate/shared_view.h: 30 % of the view volume, under 45 degrees),
// and it is a hit at k when one of the first k that are found does. Queries are made twice: as place recognition makes
// them, with the strongest features that have a map point ("mapped"), and as relocalisation does, with the strongest of
// all ("frame").
//
// "of all" is the recall at 10 over that of the exhaustive vote on all keyframes. Vocabularies: "others" is trained on
// the frames of all sequences but the tested one; --vocabulary adds one from a file. Times are those of a query on one
// thread, in processor time, so that a busy machine does not count: of what the mapping thread does ("index",
// KeyframeRetrieval::Prepare), and of the whole. A second table has them by size of the database, over all sequences
// together.
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cstdio>
#include <functional>
#include <memory>
#include <memory_resource>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "capture/open_sequence.h"
#include "engine/engine.h"
#include "engine/place/descriptor_vote.h"
#include "engine/place/make_retrieval.h"
#include "engine/place/strongest_features.h"
#include "engine/place/vocabulary.h"
#include "platform/assemble.h"
#include "platform/config/engine_config_table.h"
#include "platform/vocabulary_loader.h"
#include "tools/benchmarks/recorded_views.h"
#include "tools/benchmarks/view_atlas.h"
#include "tools/command/number_checks.h"
#include "tools/evaluate/shared_view.h"
#include "tools/evaluate/statistics.h"
#include "tools/exit_codes.h"

namespace haustra::benchmarks {
namespace {

struct Arguments {
  std::vector<std::string> sequences;
  std::string vocabulary;
  std::vector<std::string> assignments;
  int every = 8;
  int distractors = 2;
  int database = 1200;
  double gap_s = 5.0;
  int branching = 10;
  int depth = 4;
  int features = 800;  // of a picture, for training
  int words = 0;       // features of a view that are looked up in a vocabulary; 0: retrieval.max_descriptors
  int threads = 2;
  std::string device = "cpu";  // extracts, keeps, matches
};

constexpr int kMaxResults = 10;
constexpr std::array<int, 3> kRanks = {1, 5, 10};

// One way to retrieve, as a row of the tables.
struct Method {
  std::string name;
  EngineConfig config;
  const Vocabulary* vocabulary = nullptr;
};

std::vector<Method> MethodsFor(const EngineConfig& config, int words, const Vocabulary* others,
                               const Vocabulary* given) {
  std::vector<Method> methods;
  // The first is what others are compared with.
  methods.push_back({"exhaustive, all", config, nullptr});
  methods.back().config.place.retrieval.max_keyframes_per_query = 100000;
  methods.push_back(
      {"exhaustive, " + std::to_string(config.place.retrieval.max_keyframes_per_query) + " of index", config, nullptr});
  if (others != nullptr) methods.push_back({"vocabulary, others", config, others});
  if (given != nullptr) methods.push_back({"vocabulary, file", config, given});
  for (Method& method : methods) {
    method.config.place.retrieval.kind = "exhaustive";
    if (method.vocabulary == nullptr) continue;
    method.config.place.retrieval.kind = "vocabulary";
    if (words > 0) method.config.place.retrieval.max_descriptors = words;
  }
  return methods;
}

// Processor time of the whole process, which does nothing else meanwhile.
double ProcessorMs() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double MillisecondsOf(const std::function<void()>& work) {
  const double start_ms = ProcessorMs();
  work();
  return ProcessorMs() - start_ms;
}

// The views of the other sequences, evenly thinned to `num` together.
std::vector<std::size_t> Thin(std::size_t num_all, std::size_t num) {
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < std::min(num, num_all); ++i) chosen.push_back(i * num_all / std::min(num, num_all));
  return chosen;
}

Result<Vocabulary> TrainOn(const std::vector<const RecordedSequence*>& sequences, const Arguments& arguments,
                           const EngineConfig& config, VisionDevice& device) {
  VocabularySample sample;
  std::vector<std::uint8_t> descriptors(static_cast<std::size_t>(config.features.max) * kDescriptorBytes);
  std::vector<std::int32_t> strongest;
  for (const RecordedSequence* sequence : sequences) {
    for (const RecordedView& view : sequence->views) {
      HAUSTRA_TRY(device.ReadDescriptors(view.features.set, descriptors));
      SelectStrongest(view.features, arguments.features, &strongest);
      for (const std::int32_t feature : strongest) {
        const auto begin = descriptors.begin() + std::ptrdiff_t{feature} * kDescriptorBytes;
        sample.descriptors.insert(sample.descriptors.end(), begin, begin + kDescriptorBytes);
      }
      sample.picture_ends.push_back(sample.num_descriptors());
    }
  }
  VocabularyOptions options;
  options.branching = arguments.branching;
  options.depth = arguments.depth;
  options.root_sift = config.features.root_sift;
  return Vocabulary::Train(sample, options);
}

// An atlas with some keyframes as the database and some as queries.
struct Scene {
  const Atlas* atlas = nullptr;
  std::vector<KeyframeHandle> database;  // oldest first
  std::vector<PlacedView> queries;
  const evaluate::SharedView* shared_view = nullptr;
  double gap_s = 0.0;
};

bool IsOlder(const RecordedView& view, const RecordedView& query, double gap_s) {
  return ToSeconds(query.timestamp - view.timestamp) >= gap_s;
}

// The queries' own keyframes that truly show the place of query i; empty: nothing to find.
std::vector<KeyframeHandle> TrulyAlike(const Scene& scene, std::size_t i) {
  std::vector<KeyframeHandle> alike;
  const PlacedView& query = scene.queries[i];
  if (!query.view->world_from_cam || query.depth <= 0.0) return alike;
  for (const PlacedView& other : scene.queries) {
    if (!IsOlder(*other.view, *query.view, scene.gap_s)) break;
    if (!other.view->world_from_cam || other.depth <= 0.0) continue;
    const evaluate::View a{*query.view->world_from_cam, query.depth}, b{*other.view->world_from_cam, other.depth};
    if (scene.shared_view->Holds(a, b)) alike.push_back(other.keyframe);
  }
  return alike;
}

struct Figures {
  int num_queries = 0;
  std::array<int, kRanks.size()> hits{};
  std::vector<double> index_ms;
  std::vector<double> query_ms;
};

// Query in its two halves, with the time of each.
class TimedQuery {
 public:
  TimedQuery(const Method& method, VisionDevice& device)
      : votes_(method.config, method.config.place.retrieval, std::pmr::get_default_resource()),
        vote_(method.config, method.config.place.retrieval, device) {}

  Status Ask(const Atlas& atlas, const RetrievalQuery& query, KeyframeRetrieval& retrieval, Figures* figures) {
    Status status;
    const double index_ms = MillisecondsOf([&] { status = retrieval.Prepare(atlas, query, &votes_, &found_); });
    HAUSTRA_TRY(std::move(status));
    double vote_ms = 0.0;
    if (!votes_.entries.empty()) {
      vote_ms = MillisecondsOf([&] { status = vote_.Count(votes_, &found_); });
      HAUSTRA_TRY(std::move(status));
    }
    figures->index_ms.push_back(index_ms);
    figures->query_ms.push_back(index_ms + vote_ms);
    return Status::Ok();
  }
  const std::vector<RetrievalCandidate>& found() const { return found_; }

 private:
  VoteList votes_;
  DescriptorVote vote_;
  std::vector<RetrievalCandidate> found_;
};

Result<std::unique_ptr<KeyframeRetrieval>> Fill(const Scene& scene, const Method& method, VisionDevice& device,
                                                std::vector<double>* add_ms) {
  std::unique_ptr<KeyframeRetrieval> retrieval = MakeRetrieval(method.config, device, method.vocabulary);
  for (const KeyframeHandle keyframe : scene.database) {
    Status status;
    add_ms->push_back(MillisecondsOf([&] { status = retrieval->Add(*scene.atlas, keyframe); }));
    HAUSTRA_TRY(std::move(status));
  }
  return retrieval;
}

Result<Figures> Measure(const Scene& scene, const Method& method, bool is_mapped, VisionDevice& device) {
  std::vector<double> add_ms;
  HAUSTRA_ASSIGN(const std::unique_ptr<KeyframeRetrieval> retrieval, Fill(scene, method, device, &add_ms));
  Figures figures;
  TimedQuery timed(method, device);
  std::vector<std::int32_t> strongest;
  const int max_descriptors = method.config.place.retrieval.max_descriptors;
  for (std::size_t i = 0; i < scene.queries.size(); ++i) {
    const std::vector<KeyframeHandle> alike = TrulyAlike(scene, i);
    if (alike.empty()) continue;
    const PlacedView& view = scene.queries[i];
    const Keyframe& keyframe = scene.atlas->keyframe(view.keyframe);
    if (is_mapped) {
      SelectStrongestWithPoint(keyframe, max_descriptors, &strongest);
    } else {
      SelectStrongest(keyframe.features, max_descriptors, &strongest);
    }
    RetrievalQuery query;
    query.set = keyframe.features.set;
    query.strongest = strongest;
    query.max_results = kMaxResults;
    query.is_excluded = [&](KeyframeHandle, const Keyframe& other) {
      return other.map == keyframe.map && ToSeconds(keyframe.timestamp - other.timestamp) < scene.gap_s;
    };
    HAUSTRA_TRY(timed.Ask(*scene.atlas, query, *retrieval, &figures));
    const std::vector<RetrievalCandidate>& found = timed.found();
    ++figures.num_queries;
    const auto first = std::find_if(found.begin(), found.end(), [&](const RetrievalCandidate& candidate) {
      return std::find(alike.begin(), alike.end(), candidate.keyframe) != alike.end();
    });
    for (std::size_t r = 0; r < kRanks.size(); ++r)
      figures.hits[r] += first - found.begin() < kRanks[r] && first != found.end();
  }
  return figures;
}

void PrintRow(const std::string& name, const char* view, const Figures& figures, const Figures& of_all) {
  std::printf("| %-26s | %-6s |", name.c_str(), view);
  for (const int hits : figures.hits) std::printf(" %5.1f |", 100.0 * hits / figures.num_queries);
  std::printf(" %6.1f |", 100.0 * figures.hits.back() / std::max(of_all.hits.back(), 1));
  for (const std::vector<double>* times_ms : {&figures.index_ms, &figures.query_ms}) {
    const auto times = evaluate::FindPercentiles(*times_ms);
    std::printf(" %7.2f / %7.2f |", times->p50, times->p99);
  }
  std::printf("\n");
  std::fflush(stdout);
}

class Benchmark {
 public:
  Benchmark(const Arguments& arguments, const EngineConfig& config, const Vocabulary* given)
      : arguments_(arguments), config_(config), given_(given) {}

  Status Run() {
    HAUSTRA_TRY(ReadAll());
    for (const RecordedSequence& sequence : sequences_) {
      if (sequence.has_truth) HAUSTRA_TRY(TestRecall(sequence));
    }
    return TestTimes();
  }

 private:
  Status ReadAll() {
    VisionPlan plan;
    // Nothing is extracted on this device: it keeps and matches.
    plan.max_width_px = plan.max_height_px = 64;
    plan.max_features = config_.features.max;
    plan.max_match_list = config_.features.max;
    plan.max_feature_sets = 16;
    for (const std::string& path : arguments_.sequences) {
      SequenceOptions options;
      options.every_nth = static_cast<std::uint32_t>(arguments_.distractors);
      HAUSTRA_ASSIGN(const std::unique_ptr<FrameSource> source, OpenSequence(path, options));
      plan.max_feature_sets += static_cast<int>(source->num_frames());
    }
    HAUSTRA_ASSIGN(device_, CreateVisionDevice(arguments_.device, plan, Engine::ExtractOptionsFor(config_), 1));
    for (const std::string& path : arguments_.sequences) {
      HAUSTRA_ASSIGN(RecordedSequence sequence,
                     ReadViews(path, arguments_.distractors, config_, arguments_.device, arguments_.threads, *device_));
      std::printf("%s: %zu frames read%s\n", path.c_str(), sequence.views.size(),
                  sequence.has_truth ? "" : ", no groundtruth.txt");
      std::fflush(stdout);
      sequences_.push_back(std::move(sequence));
    }
    for (const RecordedSequence& sequence : sequences_) num_views_ += static_cast<int>(sequence.views.size());
    return Status::Ok();
  }

  Status TestRecall(const RecordedSequence& tested) {
    ViewAtlas atlas(config_, num_views_, *device_);
    std::vector<const RecordedSequence*> others;
    std::vector<KeyframeHandle> distractors;
    for (const RecordedSequence& sequence : sequences_) {
      if (&sequence == &tested) continue;
      others.push_back(&sequence);
      HAUSTRA_ASSIGN(const std::vector<PlacedView> placed, atlas.AddSequence(sequence, 1));
      for (const PlacedView& view : placed) distractors.push_back(view.keyframe);
    }
    Scene scene;
    HAUSTRA_ASSIGN(scene.queries, atlas.AddSequence(tested, std::max(1, arguments_.every / arguments_.distractors)));
    const evaluate::SharedView shared_view(tested.camera);
    scene.atlas = &atlas.atlas();
    scene.shared_view = &shared_view;
    scene.gap_s = arguments_.gap_s;
    const std::size_t room = static_cast<std::size_t>(std::max(0, arguments_.database)) > scene.queries.size()
                                 ? static_cast<std::size_t>(arguments_.database) - scene.queries.size()
                                 : 0;
    for (const std::size_t i : Thin(distractors.size(), room)) scene.database.push_back(distractors[i]);
    for (const PlacedView& view : scene.queries) scene.database.push_back(view.keyframe);

    std::optional<Vocabulary> trained;
    if (!others.empty() && arguments_.depth > 0) {
      HAUSTRA_ASSIGN(Vocabulary vocabulary, TrainOn(others, arguments_, config_, *device_));
      trained = std::move(vocabulary);
    }
    int num_findable = 0;
    for (std::size_t i = 0; i < scene.queries.size(); ++i) num_findable += TrulyAlike(scene, i).empty() ? 0 : 1;
    std::printf("\n%s: %zu keyframes, %zu in the database, %d queries with something to find, %d and %d words\n",
                tested.path.c_str(), scene.queries.size(), scene.database.size(), num_findable,
                trained ? trained->num_words() : 0, given_ != nullptr ? given_->num_words() : 0);
    if (num_findable == 0) return Status::Ok();
    std::printf(
        "| retrieval                  | query  |  @1 %% |  @5 %% | @10 %% | of all | index ms, p50/99  | "
        "query ms, p50/99  |\n");
    std::printf("| --- | --- | --- | --- | --- | --- | --- | --- |\n");
    std::array<Figures, 2> of_all;
    for (const Method& method : MethodsFor(config_, arguments_.words, trained ? &*trained : nullptr, given_)) {
      for (const bool is_mapped : {true, false}) {
        HAUSTRA_ASSIGN(const Figures figures, Measure(scene, method, is_mapped, *device_));
        Figures& reference = of_all[is_mapped ? 0 : 1];
        if (reference.num_queries == 0) reference = figures;
        PrintRow(method.name, is_mapped ? "mapped" : "frame", figures, reference);
      }
    }
    return Status::Ok();
  }

  Status TestTimes() {
    ViewAtlas atlas(config_, num_views_, *device_);
    std::vector<PlacedView> all;
    std::vector<const RecordedSequence*> trained_on;
    for (const RecordedSequence& sequence : sequences_) {
      HAUSTRA_ASSIGN(const std::vector<PlacedView> placed, atlas.AddSequence(sequence, 1));
      all.insert(all.end(), placed.begin(), placed.end());
      trained_on.push_back(&sequence);
    }
    std::optional<Vocabulary> trained;
    if (given_ == nullptr && arguments_.depth > 0) {
      HAUSTRA_ASSIGN(Vocabulary vocabulary, TrainOn(trained_on, arguments_, config_, *device_));
      trained = std::move(vocabulary);
    }
    constexpr std::size_t kNumQueries = 100;
    std::printf(
        "\nTimes by size of the database: %zu queries (mapped), median / p99 ms; last column: adding a keyframe\n",
        std::min(kNumQueries, all.size()));
    std::printf(
        "| retrieval                  | keyframes | index ms          | query ms          | add ms            |\n");
    std::printf("| --- | --- | --- | --- | --- |\n");
    for (const Method& method : MethodsFor(config_, arguments_.words, trained ? &*trained : nullptr, given_)) {
      for (const std::size_t size : {std::size_t{100}, std::size_t{300}, std::size_t{1000}, std::size_t{3000}}) {
        if (size > all.size() || size > static_cast<std::size_t>(arguments_.database)) continue;
        Scene scene;
        scene.atlas = &atlas.atlas();
        for (const std::size_t i : Thin(all.size(), size)) scene.database.push_back(all[i].keyframe);
        std::vector<double> add_ms;
        Figures figures;
        TimedQuery timed(method, *device_);
        HAUSTRA_ASSIGN(const std::unique_ptr<KeyframeRetrieval> retrieval, Fill(scene, method, *device_, &add_ms));
        std::vector<std::int32_t> strongest;
        for (const std::size_t i : Thin(all.size(), kNumQueries)) {
          const Keyframe& keyframe = scene.atlas->keyframe(all[i].keyframe);
          SelectStrongestWithPoint(keyframe, method.config.place.retrieval.max_descriptors, &strongest);
          RetrievalQuery query;
          query.set = keyframe.features.set;
          query.strongest = strongest;
          query.max_results = kMaxResults;
          HAUSTRA_TRY(timed.Ask(*scene.atlas, query, *retrieval, &figures));
        }
        std::printf("| %-26s | %9zu |", method.name.c_str(), size);
        for (const std::vector<double>* times_ms : {&figures.index_ms, &figures.query_ms, &add_ms}) {
          const auto times = evaluate::FindPercentiles(*times_ms);
          std::printf(" %7.3f / %7.3f |", times->p50, times->p99);
        }
        std::printf("\n");
        std::fflush(stdout);
      }
    }
    return Status::Ok();
  }

  const Arguments& arguments_;
  const EngineConfig& config_;
  const Vocabulary* given_;
  std::unique_ptr<VisionDevice> device_;
  std::vector<RecordedSequence> sequences_;
  int num_views_ = 0;
};

int Run(const Arguments& arguments) {
  const auto fail = [](const Status& status) {
    std::fprintf(stderr, "haustra_retrieval_benchmark: %s\n", status.message().c_str());
    return ExitCodeFor(status.code());
  };
  const Result<ConfigStore<EngineConfig>> loaded_config = LoadEngineConfig("", arguments.assignments);
  if (!loaded_config.ok()) return fail(loaded_config.status());
  EngineConfig config = loaded_config->config();
  config.memory.max_keyframes = std::max(config.memory.max_keyframes, arguments.database);
  std::optional<Vocabulary> given;
  if (!arguments.vocabulary.empty()) {
    Result<Vocabulary> loaded = LoadVocabulary(arguments.vocabulary);
    if (!loaded.ok()) return fail(loaded.status());
    if (const Status status = CheckVocabulary(config, *loaded); !status.ok()) return fail(status);
    given = std::move(*loaded);
  }
  Benchmark benchmark(arguments, config, given ? &*given : nullptr);
  const Status status = benchmark.Run();
  return status.ok() ? static_cast<int>(kExitOk) : fail(status);
}

}  // namespace
}  // namespace haustra::benchmarks

int main(int argc, char** argv) {
  haustra::benchmarks::Arguments arguments;
  CLI::App app{"Recall and time of retrieval on sequences with ground truth"};
  app.add_option("sequences", arguments.sequences, "Sequences; those with groundtruth.txt are tested")->required();
  app.add_option("--vocabulary", arguments.vocabulary, "A vocabulary to test beside those that are trained here");
  app.add_option("--every", arguments.every, "Of the tested sequence, every n-th frame is a keyframe")
      ->transform(haustra::WholeNumberBetween(1, 1000))
      ->capture_default_str();
  app.add_option("--distractors", arguments.distractors, "Of the other sequences, every n-th frame is a keyframe")
      ->transform(haustra::WholeNumberBetween(1, 1000))
      ->capture_default_str();
  app.add_option("--database", arguments.database, "Keyframes of the database")
      ->transform(haustra::WholeNumberBetween(1, 100000))
      ->capture_default_str();
  app.add_option("--gap", arguments.gap_s, "Age of a keyframe from which on it is to be found, s")
      ->check(haustra::NumberBetween(0.0, 3600.0))
      ->capture_default_str();
  app.add_option("--branching", arguments.branching, "Of the vocabularies that are trained here")
      ->capture_default_str();
  app.add_option("--depth", arguments.depth, "Of the vocabularies that are trained here; 0: none is")
      ->transform(haustra::WholeNumberBetween(0, 8))
      ->capture_default_str();
  app.add_option("--features", arguments.features, "Of each picture, for training")->capture_default_str();
  app.add_option("--words", arguments.words,
                 "Features of a view that vocabularies look up; 0: as the configuration says")
      ->transform(haustra::WholeNumberBetween(0, 8000))
      ->capture_default_str();
  app.add_option("--threads", arguments.threads, "For reading the sequences")->capture_default_str();
  app.add_option("--device", arguments.device, "cpu or cuda")->capture_default_str();
  app.add_option("--set", arguments.assignments, "Overrides one key of the configuration: section.key=value");
  CLI11_PARSE(app, argc, argv);
  return haustra::benchmarks::Run(arguments);
}
