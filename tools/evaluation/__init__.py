"""Evaluation of detectors on annotated pictures, by COCO's measures.

`dataset` reads annotations of COCO, YOLO and Pascal VOC, `figures` measures, `errors` draws what
went wrong.
"""
