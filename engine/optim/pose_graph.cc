#include "engine/optim/pose_graph.h"

#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <exception>
#include <string>

#include "engine/optim/sim3_edge_cost.h"
#include "engine/optim/stop_callback.h"

namespace haustra {
namespace {

using optim::LeftSim3Manifold;
using optim::Sim3EdgeCost;
using optim::StopCallback;

bool IsValid(const Sim3& transform) {
  return transform.scale > 0 && std::isfinite(transform.scale) && transform.rotation.coeffs().allFinite() &&
         transform.translation.allFinite();
}

Status Validate(const PoseGraphOptions& options, std::span<const PoseGraphEdge> edges,
                const std::vector<PoseGraphNode>& nodes) {
  if (options.max_iterations < 1) {
    return InvalidArgument("PoseGraphOptions.max_iterations is " + std::to_string(options.max_iterations) +
                           ", must be at least 1");
  }
  if (!(options.translation_unit_mu >= 0) || !std::isfinite(options.translation_unit_mu)) {
    return InvalidArgument("PoseGraphOptions.translation_unit_mu is " + std::to_string(options.translation_unit_mu) +
                           ", must not be negative");
  }
  if (options.deadline != kNoDeadline && options.clock == nullptr) {
    return InvalidArgument("PoseGraphOptions.deadline is set without a clock");
  }
  if (options.progress != nullptr && !options.progress->nodes.empty() &&
      options.progress->nodes.size() != nodes.size()) {
    return InvalidArgument("PoseGraphOptions.progress is that of " + std::to_string(options.progress->nodes.size()) +
                           " nodes, there are " + std::to_string(nodes.size()));
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!IsValid(nodes[i].node_from_world)) {
      return InvalidArgument("nodes[" + std::to_string(i) + "] is not finite, or its scale is not positive");
    }
  }
  const int num_nodes = static_cast<int>(nodes.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const PoseGraphEdge& edge = edges[i];
    const std::string name = "edges[" + std::to_string(i) + "]";
    for (const int node : {edge.a, edge.b}) {
      if (node < 0 || node >= num_nodes) {
        return InvalidArgument(name + " names node " + std::to_string(node) + ", there are " +
                               std::to_string(num_nodes));
      }
    }
    if (edge.a == edge.b) return InvalidArgument(name + " leads from node " + std::to_string(edge.a) + " to itself");
    if (!(edge.weight > 0) || !std::isfinite(edge.weight)) {
      return InvalidArgument(name + ".weight is " + std::to_string(edge.weight) + ", must be positive");
    }
    if (!IsValid(edge.b_from_a)) {
      return InvalidArgument(name + ".b_from_a is not finite, or its scale is not positive");
    }
  }
  return Status::Ok();
}

double TranslationUnit(const PoseGraphOptions& options, std::span<const PoseGraphEdge> edges) {
  if (options.translation_unit_mu > 0) return options.translation_unit_mu;
  double sum = 0.0;
  for (const PoseGraphEdge& edge : edges) sum += edge.b_from_a.translation.norm();
  return sum > 0 ? sum / static_cast<double>(edges.size()) : 1.0;
}

ceres::Problem::Options ProblemOptions() {
  ceres::Problem::Options options;
  options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  options.disable_all_safety_checks = true;
  return options;
}

using NodeParameters = std::vector<std::array<double, LeftSim3Manifold::kAmbientSize>>;

void KeepProgress(const NodeParameters& parameters, const ceres::Solver::Summary& solved, PoseGraphProgress* progress) {
  if (progress->nodes.empty()) progress->initial_cost = solved.initial_cost;
  progress->nodes.clear();
  for (const auto& node : parameters) progress->nodes.push_back(LeftSim3Manifold::Load(node.data()));
  if (solved.iterations.empty()) return;
  progress->trust_region_radius = solved.iterations.back().trust_region_radius;
  progress->iterations += static_cast<int>(solved.iterations.size()) - 1;
}

PoseGraphSummary Solve(const PoseGraphOptions& options, std::span<const PoseGraphEdge> edges,
                       std::vector<PoseGraphNode>* nodes) {
  // One array in the order of the indices: Ceres orders parameters by address.
  NodeParameters parameters(nodes->size());
  for (std::size_t i = 0; i < nodes->size(); ++i) {
    const bool goes_on = options.progress != nullptr && !options.progress->nodes.empty();
    LeftSim3Manifold::Store(goes_on ? options.progress->nodes[i] : (*nodes)[i].node_from_world, parameters[i].data());
  }
  LeftSim3Manifold manifold;
  std::deque<Sim3EdgeCost> costs;
  std::vector<bool> has_edge(nodes->size(), false);
  const double unit = TranslationUnit(options, edges);
  ceres::Problem problem(ProblemOptions());
  for (const PoseGraphEdge& edge : edges) {
    costs.emplace_back(edge.b_from_a, std::sqrt(edge.weight), unit);
    problem.AddResidualBlock(&costs.back(), nullptr, parameters[edge.a].data(), parameters[edge.b].data());
    has_edge[edge.a] = has_edge[edge.b] = true;
  }

  PoseGraphSummary summary;
  std::vector<bool> is_free(nodes->size(), false);
  bool has_fixed = false;
  for (std::size_t i = 0; i < nodes->size(); ++i) has_fixed = has_fixed || (has_edge[i] && (*nodes)[i].is_fixed);
  bool has_free = false;
  for (std::size_t i = 0; i < nodes->size(); ++i) {
    if (!has_edge[i]) continue;
    problem.SetManifold(parameters[i].data(), &manifold);
    is_free[i] = has_fixed && !(*nodes)[i].is_fixed;
    if (!is_free[i]) problem.SetParameterBlockConstant(parameters[i].data());
    // Without a fixed node, this first one with an edge holds the others.
    has_fixed = true;
    has_free = has_free || is_free[i];
  }
  if (!has_free) return summary;

  StopCallback callback(options.should_stop, options.deadline, options.clock);
  ceres::Solver::Options solver;
  solver.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  // Not SuiteSparse: its sums depend on the BLAS of the machine and on that one's threads.
  solver.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  solver.max_num_iterations = options.max_iterations;
  if (PoseGraphProgress* progress = options.progress; progress != nullptr && !progress->nodes.empty()) {
    solver.max_num_iterations = std::max(1, options.max_iterations - progress->iterations);
    solver.initial_trust_region_radius = progress->trust_region_radius;
  }
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  solver.callbacks.push_back(&callback);
  ceres::Solver::Summary solved;
  ceres::Solve(solver, &problem, &solved);

  summary.iterations = std::max(0, static_cast<int>(solved.iterations.size()) - 1);
  summary.initial_cost = solved.initial_cost;
  summary.final_cost = solved.final_cost;
  if (!solved.IsSolutionUsable() || !std::isfinite(solved.final_cost)) return summary;
  const bool has_converged = solved.termination_type == ceres::CONVERGENCE && !callback.has_stopped();
  if (options.progress != nullptr) {
    KeepProgress(parameters, solved, options.progress);
    summary.iterations = options.progress->iterations;
    summary.initial_cost = options.progress->initial_cost;
  }
  summary.state = has_converged ? SolveState::kConverged : SolveState::kPartial;
  if (!has_converged) return summary;
  for (std::size_t i = 0; i < nodes->size(); ++i) {
    if (is_free[i]) (*nodes)[i].node_from_world = LeftSim3Manifold::Load(parameters[i].data());
  }
  return summary;
}

}  // namespace

Result<PoseGraphSummary> OptimizePoseGraphSim3(const PoseGraphOptions& options, std::span<const PoseGraphEdge> edges,
                                               std::vector<PoseGraphNode>* nodes) {
  HAUSTRA_TRY(Validate(options, edges, *nodes));
  try {
    return Solve(options, edges, nodes);
  } catch (const std::exception& error) {
    return Internal(std::string("pose graph: Ceres threw ") + error.what());
  }
}

}  // namespace haustra
