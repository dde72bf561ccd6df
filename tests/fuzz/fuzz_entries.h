// Parsers of bytes from outside, each as a function of any bytes. What must never happen stops the process; what is
// taken must be sound.
#pragma once

#include <cstdint>
#include <span>

namespace haustra::test {

void FuzzAtlasReader(std::span<const std::uint8_t> bytes);  // as it is, and with its checksums put right
void FuzzControlProtocol(std::span<const std::uint8_t> bytes);
void FuzzConfig(std::span<const std::uint8_t> bytes);       // configuration files and --set
void FuzzCalibration(std::span<const std::uint8_t> bytes);  // all formats
void FuzzTrajectory(std::span<const std::uint8_t> bytes);   // ground truth: TUM, EuRoC, C3VD
void FuzzImage(std::span<const std::uint8_t> bytes);        // PNG, JPEG
void FuzzVideo(std::span<const std::uint8_t> bytes);        // headers and frames of recordings
void FuzzDepthFile(std::span<const std::uint8_t> bytes);    // as it is, and with its checksums put right
void FuzzVocabulary(std::span<const std::uint8_t> bytes);   // likewise
void FuzzTable(std::span<const std::uint8_t> bytes);        // marks of a run, the true wall
void FuzzRangePicture(std::span<const std::uint8_t> bytes);
void FuzzEventScript(std::span<const std::uint8_t> bytes);  // haustra render --events
void FuzzCameraSpec(std::span<const std::uint8_t> bytes);   // v4l2:...
void FuzzCpuList(std::span<const std::uint8_t> bytes);      // rt.*_cpus
void FuzzColmap(std::span<const std::uint8_t> bytes);       // cameras.txt, images.txt, points3D.txt
void FuzzRunOutput(std::span<const std::uint8_t> bytes);    // tables and summary.json of a run
void FuzzRequestGate(std::span<const std::uint8_t> bytes);  // who may see haustra view, and its token

}  // namespace haustra::test
