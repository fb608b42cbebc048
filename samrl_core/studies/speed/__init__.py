"""Speed and accuracy of the model beside its peers, every one measured in the same run."""
