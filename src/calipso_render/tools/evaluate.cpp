#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include "calipso_render/renderer.hpp"
#include "truth.hpp"
using namespace calipso; using namespace calipso::render;
static double now(){ return std::chrono::duration<double,std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count(); }
static double psnr(const cv::Mat&a,const cv::Mat&b,const cv::Mat&m){ cv::Mat d; cv::absdiff(a,b,d); d.convertTo(d,CV_32F); d=d.mul(d); cv::Scalar s=cv::mean(d,m); double e=(s[0]+s[1]+s[2])/3; return e>0?10*log10(255*255/e):99; }
int main(int argc,char**argv){
  for(int a=1;a<argc;a++){
    Scene scene=loadScene(argv[a]); Truth truth=loadTruth(scene);
    ClipSample clip; std::vector<ObjectModel> models;
    for(auto&o:truth.objects) models.push_back(o.model);
    for(int k=0;k<scene.frame_count;k++) clip.add({loadFrame(scene,k),loadLabels(scene,k),scene.camera});
    RenderParams params; params.planes=scene.planes; params.up=-scene.gravity.normalized();
    double t0=now(); auto p=std::make_shared<Prepared>(prepare(clip,models,params)); double t1=now();
    cv::Mat plate8; p->background.plate.convertTo(plate8,CV_8U);
    auto tp=loadPlate(scene,0);
    printf("%s prepare %.0f ms seen %.2f inv %.2f light err %.1f", scene.name.c_str(), t1-t0, psnr(plate8,*tp,p->background.invented==0), psnr(plate8,*tp,p->background.invented), acos(p->light.light.direction.cast<double>().dot(*truth.to_sun))*180/M_PI);
    std::cout<<" umbra "<<p->umbra<<" sun "<<p->light.light.sun<<" amb "<<p->light.light.ambient[0];
    for(int t=0;t<3;t++){
    RenderParams q=params; if(t<2) q.keep_still=false, q.add_noise=false;
    Renderer r(p,q);
    FrameInput f; f.bgr=loadFrame(scene,0); f.labels=loadLabels(scene,0); f.camera=scene.camera; f.stamp_ns=1;
    for(size_t i=0;i<models.size();i++){ ObjectInFrame o; o.name=models[i].name; o.edited= t==0||i==0; o.vertices=p->surfaces[i].key_vertices; if(t==2){ for(auto&v:o.vertices) { double lift=scene.camera.world_from_camera.translation().norm()*0.06; v+= Eigen::Vector3f(0,0,lift);} } f.objects.push_back(o);}
    double t2=now(); FrameOutput out=r.composite(f); double t3=now(); out=r.composite(f); double t4=now();
    cv::Mat in=f.labels!=0, seam, big, small; cv::Mat k7=cv::Mat::ones(7,7,CV_8U); cv::dilate(in,big,k7); cv::erode(in,small,k7); seam=big&~small;
    if(t==0){cv::Mat st; cv::Mat key=steadyKeyFrame(clip.frames(),st); cv::Mat k8; key.convertTo(k8,CV_8U);
      printf(" undef in %.2f seam %.2f", psnr(out.bgr,k8,small), psnr(out.bgr,k8,seam));}
    printf(" ms %.1f %.1f", t3-t2,t4-t3);
    std::string n="/tmp/rv/"+scene.name+"_"+std::to_string(t); cv::imwrite(n+".png",out.bgr); cv::imwrite(n+"_p.png",out.provenance*80);}
    printf("\n"); cv::imwrite("/tmp/rv/"+scene.name+"_plate.png",plate8);
  }
}
