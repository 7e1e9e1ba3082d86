#include "config/keys.hpp"

namespace binpick::config {
// A table, one key each: the formatter would give every field its own line.
// clang-format off
const Section<Part>& part_section() {
  using enum Type;
  using P = Part;
  static const Section<Part> section = {
      "",
      "The part. Only the mesh has to be named; everything else has a default that is derived from it.",
      {
          {{.name = "mesh", .type = Path, .required = true, .example = "\"track_link.stl\"",
            .help = "STL, OBJ or PLY."},
           [](P& p) -> Slot { return &p.mesh_path; }},
          {{.name = "mesh_unit", .type = Choice, .default_value = "\"mm\"", .choices = {"mm", "cm", "m", "inch"},
            .help = "Unit of the mesh's coordinates."},
           [](P& p) -> Slot {
             static constexpr double kMillimetres[] = {1, 10, 1000, 25.4};
             return Chosen{[&p](std::size_t i) { p.mesh_unit_mm = kMillimetres[i]; }, [] { return std::size_t{0}; }};
           }},
          {{.name = "name", .type = Text, .sample = "\"track link\"",
            .help = "Default: the name of the part file."},
           [](P& p) -> Slot { return &p.options.name; }},
          {{.name = "scanner", .type = Choice, .example = "\"lms400\"", .choices = {"lps36hi", "lps36", "lms400"},
            .help = "Device class that sees the part: expected noise and point spacing. Default: lps36 for parts "
                    "under 150 mm diameter, else lms400."},
           [](P& p) -> Slot {
             return Chosen{[&p](std::size_t i) { p.options.scanner = static_cast<vision::ScannerClass>(i); },
                           [] { return std::size_t{0}; }};
           }},
          {{.name = "picking", .type = Choice, .default_value = "\"bin\"", .choices = {"bin", "conveyor"},
            .help = "bin: the part lies in any rotation; conveyor: each alone, as it rests on a belt."},
           [](P& p) -> Slot {
             return Chosen{[&p](std::size_t i) { p.options.picking = static_cast<vision::Picking>(i); },
                           [&p] { return static_cast<std::size_t>(p.options.picking); }};
           }},
          {{.name = "pixel_mm", .type = Number, .unit = "mm", .min = 0.05, .max = 50, .sample = "2",
            .help = "Edge of a pixel of the depth image. Default: from the mesh and the scanner."},
           [](P& p) -> Slot { return &p.options.pixel_mm; }},
          {{.name = "rotations", .type = Integer, .min = 1, .max = 100000, .sample = "2000",
            .help = "Training rotations, before the symmetry reduces them. Default: from the mesh."},
           [](P& p) -> Slot { return &p.options.rotations; }},
          {{.name = "symmetry_tolerance_mm", .type = Number, .unit = "mm", .min = 0.001, .max = 100, .sample = "1.5",
            .help = "How far (rms) the part may differ from itself after a turn that is taken for a symmetry. "
                    "Default: from the scanner's noise."},
           [](P& p) -> Slot { return &p.options.symmetry_tolerance_mm; }},
          {{.name = "votes_per_feature_max", .type = Integer, .min = 1, .max = 1000000, .sample = "400",
            .help = "A feature that is seen more often tells nothing and is dropped. Default: from the mesh."},
           [](P& p) -> Slot { return &p.options.votes_per_feature_max; }},
          {{.name = "seed", .type = Integer, .min = 1, .max = 2147483647, .default_value = "1",
            .help = "Of what is random in training; the same seed gives the same knowledge base."},
           [](P& p) -> Slot { return &p.options.seed; }},
      }};
  return section;
}

const Section<SymmetryEntry>& symmetry_section() {
  using enum Type;
  using S = SymmetryEntry;
  static const Section<SymmetryEntry> section = {
      "symmetry",
      "Turns that the part looks the same after. Without this section they are found from the mesh.",
      {
          {{.name = "kind", .type = Choice, .required = true, .example = "\"none\"",
            .choices = {"none", "cyclic", "dihedral", "revolution", "revolution_flip", "sphere"},
            .help = "cyclic: turns by 360 / fold degrees about axis; dihedral: these and half a turn about "
                    "flip_axis; revolution: any turn about axis; revolution_flip: that and half a turn across it."},
           [](S& s) -> Slot {
             return Chosen{[&s](std::size_t i) { s.kind = i; }, [&s] { return s.kind; }};
           }},
          {{.name = "fold", .type = Integer, .min = 1, .max = 24, .default_value = "2",
            .help = "Of cyclic and dihedral; fold 1 with dihedral is the half turn alone."},
           [](S& s) -> Slot { return &s.fold; }},
          {{.name = "axis", .type = Vector, .min = -1, .max = 1, .default_value = "[0, 0, 1]",
            .help = "In the mesh's frame; any length but zero."},
           [](S& s) -> Slot { return &s.axis; }},
          {{.name = "flip_axis", .type = Vector, .min = -1, .max = 1, .default_value = "[1, 0, 0]",
            .help = "Of dihedral; at right angles to axis."},
           [](S& s) -> Slot { return &s.flip_axis; }},
          {{.name = "centre_mm", .type = Vector, .unit = "mm", .min = -10000, .max = 10000,
            .sample = "[0, 0, 12.5]",
            .help = "A point that all these turns leave where it is. Default: the centroid of the mesh's surface; another "
                    "one only helps a part that is not quite symmetric."},
           [](S& s) -> Slot { return &s.centre_mm; }},
      }};
  return section;
}

const Section<vision::Grasp>& grasp_section() {
  using enum Type;
  using G = vision::Grasp;
  static const Section<vision::Grasp> section = {
      "grasp",
      "A way to take the part. One entry for each.",
      {
          {{.name = "name", .type = Text, .default_value = "\"\"", .example = "\"from above\"",
            .help = "For the log."},
           [](G& g) -> Slot { return &g.name; }},
          {{.name = "T_object_tcp", .type = Transform, .required = true,
            .example = "{ xyz_mm = [0, 0, 25], rpy_deg = [180, 0, 90] }",
            .help = "The tcp when the part is taken, in the mesh's frame. Its z axis points out of the tool, into "
                    "the part; the jaws move along its x axis."},
           [](G& g) -> Slot { return &g.T_object_tcp.iso; }},
          {{.name = "approach_mm", .type = Number, .unit = "mm", .min = 0, .max = 2000, .default_value = "100",
            .help = "The approach pose stands this far back along the tcp's z axis."},
           [](G& g) -> Slot { return &g.approach_mm; }},
          {{.name = "opening_mm", .type = Number, .unit = "mm", .min = 0, .max = 5000, .sample = "140",
            .help = "Between the inner faces of the jaws on the way in. Default: gripper.opening_max_mm."},
           [](G& g) -> Slot { return &g.opening_mm; }},
          {{.name = "holding_mm", .type = Number, .unit = "mm", .min = 0, .max = 5000, .example = "120",
            .help = "The same when they hold the part; needed where the gripper has jaws. More than on the way in: they "
                    "hold it from within, in a bore."},
           [](G& g) -> Slot { return &g.holding_mm; }},
          {{.name = "retreat_mm", .type = Number, .unit = "mm", .min = 0, .max = 5000, .default_value = "0",
            .help = "The part is lifted straight up from the grasp; in a supply that stands slanted the way has to be "
                    "free so far. 0: until it is out of the supply and over all that was measured."},
           [](G& g) -> Slot { return &g.retreat_mm; }},
          {{.name = "preference", .type = Number, .min = -100, .max = 100, .default_value = "0",
            .help = "Of the grasps of one object that are free, one with the highest value is taken; 0 for most."},
           [](G& g) -> Slot { return &g.preference; }},
      }};
  return section;
}

const Section<GripperEntry>& gripper_section() {
  using enum Type;
  using G = GripperEntry;
  static const Section<GripperEntry> section = {
      "gripper",
      "The two jaws that take the part, so that they are kept clear of all else. Without this section it is a gripper "
      "without jaws (magnet, suction cup).",
      {
          {{.name = "opening_max_mm", .type = Number, .unit = "mm", .min = 0.1, .max = 5000, .required = true,
            .example = "140",
            .help = "Between the inner faces of the jaws when it is open."},
           [](G& g) -> Slot { return &g.jaws.opening_max_mm; }},
          {{.name = "jaw_size_mm", .type = Vector, .unit = "mm", .min = 0.1, .max = 2000, .required = true,
            .example = "[12, 40, 80]",
            .help = "Of one jaw in the tcp's frame: thickness along x, the way it moves; width along y; length along z."},
           [](G& g) -> Slot { return &g.jaws.size_mm; }},
          {{.name = "beyond_mm", .type = Number, .unit = "mm", .min = -1000, .max = 1000, .default_value = "0",
            .example = "20",
            .help = "The tips of the jaws stand this far beyond the tcp."},
           [](G& g) -> Slot { return &g.jaws.beyond_mm; }},
      }};
  return section;
}

const Section<GripperBodyEntry>& gripper_body_section() {
  using enum Type;
  using B = GripperBodyEntry;
  static const Section<GripperBodyEntry> section = {
      "gripper_body",
      "What else moves with the tcp: palm, hoses, a camera, the arm's last axis. One entry for each box or cylinder.",
      {
          {{.name = "shape", .type = Choice, .required = true, .example = "\"box\"", .choices = {"box", "cylinder"},
            .help = "A cylinder's axis is z."},
           [](B& b) -> Slot {
             return Chosen{[&b](std::size_t i) { b.solid.shape = static_cast<vision::Gripper::Solid::Shape>(i); },
                           [&b] { return static_cast<std::size_t>(b.solid.shape); }};
           }},
          {{.name = "size_mm", .type = Vector, .unit = "mm", .min = 0.1, .max = 5000, .required = true,
            .example = "[170, 90, 120]",
            .help = "A box's edges along x, y and z; of a cylinder diameter, diameter, length."},
           [](B& b) -> Slot { return &b.solid.size_mm; }},
          {{.name = "T_tcp_solid", .type = Transform, .required = true,
            .example = "{ xyz_mm = [0, 0, -120], rpy_deg = [0, 0, 0] }",
            .help = "Its middle and directions in the tcp's frame, whose z axis points out of the tool."},
           [](B& b) -> Slot { return &b.solid.T_tcp_solid; }},
      }};
  return section;
}
// clang-format on
}  // namespace binpick::config
