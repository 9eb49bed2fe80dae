#include "world_case.hpp"

namespace calipso::flow {

fem::WorldScene worldOf(const Scene& scene, const ObjectModel& model) {
  fem::WorldScene world;
  world.camera = scene.camera;
  world.gravity = scene.gravity;
  world.planes = scene.planes;
  for (const std::string& path : scene.support_meshes)
    world.support_meshes.push_back({path, loadMesh(path)});
  fem::WorldObject object;
  object.name = model.name;
  object.index = model.index;
  object.mesh = model.mesh;
  object.world_from_object = model.world_from_object;
  object.attachments = scene.object(model.name).attachments;
  world.objects.push_back(object);
  return world;
}

}  // namespace calipso::flow
