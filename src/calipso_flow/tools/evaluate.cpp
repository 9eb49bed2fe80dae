#include <calipso_scene/scene.hpp>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <opencv2/imgcodecs.hpp>

#include "calipso_flow/clip_dynamics.hpp"
#include "truth.hpp"
using namespace calipso;
using namespace calipso::flow;
static double cpu(){return 1e3*std::clock()/CLOCKS_PER_SEC;}
int main(int argc,char**argv){
  for(int a=1;a<argc;++a){
    std::string dir=argv[a];
    Scene scene=loadScene(dir);
    std::vector<ObjectModel> models; std::vector<cv::Mat> masks; std::vector<TrueObject> truths;
    for(auto&o:scene.objects){
      auto t=readTruth(dir,o.name); if(!t) continue;
      ObjectModel m; m.name=o.name;m.index=o.index;m.mesh=loadMesh(t->mesh_path);m.world_from_object=t->world_from_object[0];
      models.push_back(m);masks.push_back(cv::imread(t->mask_path,0));truths.push_back(*t);
    }
    std::unique_ptr<ClipAnalyser> an;
    double t0=cpu();
    char buf[500];
    for(int k=0;k<scene.frame_count;++k){
      std::snprintf(buf,500,(dir+"/"+scene.frame_pattern).c_str(),k);
      cv::Mat im=cv::imread(buf);
      Camera c=scene.camera; if(!scene.world_from_camera_per_frame.empty()) c.world_from_camera=scene.world_from_camera_per_frame[k];
      Frame f=makeFrame(k/scene.fps,im,c);
      if(!an) an.reset(new ClipAnalyser(f,models,masks,scene.gravity)); else an->add(f);
    }
    double t1=cpu();
    auto res=an->finish();
    double t2=cpu();
    std::printf("== %s  track %.2f ms/frame, fit %.2f ms/frame\n",dir.c_str(),(t1-t0)/scene.frame_count,(t2-t1)/scene.frame_count);
    for(size_t i=0;i<res.size();++i){
      auto&r=res[i]; auto&t=truths[i];
      Eigen::Vector3d c=centroid(models[i].mesh);
      std::printf("%s noise %.2f\n",r.name.c_str(),r.trajectory.noise_scale);
      for(auto&p:r.trajectory.pieces) std::printf("  piece %.3f fr travel %d jerk %g turning %d spin %g\n",p.start*scene.fps,(int)p.travel,p.jerk,(int)p.turning,p.spin_noise);
      for(auto&q:r.trajectory.collisions) std::printf("  collision %.3f +- %.3f fr  vz %.3f -> %.3f e=%.3f\n",q.time*scene.fps,q.time_deviation*scene.fps,q.before.velocity.z(),q.after.velocity.z(),q.restitution());
      for(auto&q:t.collisions) std::printf("  TRUE      %.3f  vz %.3f -> %.3f\n",q.time*scene.fps,q.velocity_before.z(),q.velocity_after.z());
      if(r.trajectory.gravity) std::printf("  gravity %.3f +- %.3f\n",r.trajectory.gravity->acceleration.norm(),r.trajectory.gravity->deviation);
      for(size_t k=0;k<r.motions.size();++k){
        auto&m=r.motions[k]; auto&o=r.observations[k];
        Eigen::Isometry3d T=t.world_from_object.size()>1?t.world_from_object[k]:t.world_from_object[0];
        Eigen::Vector3d v=t.velocity.empty()?Eigen::Vector3d::Zero():t.velocity[std::min(k,t.velocity.size()-1)];
        Eigen::Vector3d w=t.spin.empty()?Eigen::Vector3d::Zero():t.spin[std::min(k,t.spin.size()-1)];
        Eigen::Vector3d pe=o.world_from_object*c-T*c;
        std::printf("%3zu fnd %d in %3d/%3zu dev %.2f  obs err mm %6.2f %6.2f %6.2f sig %.2f rot %.3f deg | v err %.3f %.3f %.3f (sig %.3f) of %.3f  w err %.3f (%.3f) of %.3f mov %d a %.2f %.2f %.2f\n",k,o.found,m.tracks,o.tracks.size(),o.deviation,1e3*pe.x(),1e3*pe.y(),1e3*pe.z(),1e3*std::sqrt(o.covariance.topLeftCorner<3,3>().trace()),57.3*Eigen::AngleAxisd(o.world_from_object.linear()*T.linear().transpose()).angle(),
          m.state.velocity.x()-v.x(),m.state.velocity.y()-v.y(),m.state.velocity.z()-v.z(),std::sqrt(m.state.twistCovariance().topLeftCorner<3,3>().trace()),v.norm(),(m.state.spin-w).norm(),std::sqrt(m.state.twistCovariance().bottomRightCorner<3,3>().trace()),w.norm(),m.moving,m.state.acceleration.x(),m.state.acceleration.y(),m.state.acceleration.z());
      }
    }
  }
}
